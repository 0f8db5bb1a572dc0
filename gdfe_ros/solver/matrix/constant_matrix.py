# SPDX-License-Identifier: Apache-2.0
"""The constant global matrix: one n x n system for x, y and z, factored once (Sec. 3.2).

The matrix does not couple x, y and z, but the rotation of a handle does. The rigid rows (see `Unknowns`) are therefore
coupled to the free vertices by block elimination. About the rest pose, a handle moves its vertices by dx = dt + dtheta
x r, with the undeformed position r relative to its centre. Let B be the motion of the handles' vertices by the rigid
rows. Free vertices (f) and handles' vertices (m) are blocks of the matrix A. With H = A_ff^-1 A_fm B, a unit motion of
the rigid rows moves the free vertices by -H. The rigid rows have the Schur complement S = B^T A_mm B - (A_fm B)^T H.

Equal matrices in a process have one factor.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import NamedTuple
from weakref import WeakValueDictionary

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel, vector_kernel
from gdfe_ros.mesh.cells.operators import ShapeOperators
from gdfe_ros.solver.elements.cell_type import cell_type_of
from gdfe_ros.solver.matrix.fronts import Fronts
from gdfe_ros.solver.matrix.substitution import Inverse, apply_free, solve_rigid
from gdfe_ros.solver.matrix.unknowns import (
    HandlePositions,
    Unknowns,
    clear_fixed,
    generalise,
    handle_centres,
    rigid_motion,
)
from gdfe_ros.solver.vectors import Array


class Factor:
    """A factored matrix.

    Args:
        matrix: (f, f), symmetric positive definite.
        points: (f, 3) positions of its vertices [m].

    Attributes:
        inverse: the inverse for the kernels. The matrix of a body that nothing holds may be indefinite by rounding. A
            small multiple of the largest diagonal entry is then added to the diagonal before the inversion.
    """

    COARSE_FROM = 4_000_000
    """A factor with at least this number of entries is stored in single precision."""
    REGULAR = 1e-12
    """Multiple of the largest diagonal entry that is added to the diagonal of a matrix without a factor. It grows
    tenfold until the matrix has a factor.
    """
    ZEROS = 0.3
    """Largest fraction of zeros in a supernode. This matrix is factored once and used often; broad supernodes are then
    fastest.
    """
    REFINED = 3
    """Number of iterative refinements of a solution with a factor in single precision."""

    def __init__(self, matrix: sparse.csc_matrix, points: Array) -> None:
        self._matrix = matrix
        graph = matrix.tocsr()
        graph.sort_indices()
        fronts, added = Fronts(graph, points, size=1, slack=self.ZEROS, kind=np.float64), self.REGULAR
        own = graph.indices == np.repeat(np.arange(len(points)), np.diff(graph.indptr))
        while not fronts.factor(graph.data[:, None, None]):
            graph.data[own] += added * graph.data[own].max()
            added *= 10.0
        kept = fronts.kept
        self._refined = self.REFINED if len(kept.values) >= self.COARSE_FROM else 0
        values = kept.values.astype(np.float32) if self._refined else kept.values
        self.inverse = Inverse(kept.plan, kept.order, values)

    def solve(self, right: Array, out: Array) -> None:
        """Write the solution (f, 3) of three right-hand sides (f, 3) to ``out``, to double precision."""
        apply_free(self.inverse, right.reshape(-1), out.reshape(-1))
        for _ in range(self._refined):
            change = np.empty_like(out)
            apply_free(self.inverse, (right - self._matrix @ out).reshape(-1), change.reshape(-1))
            out += change


_MADE: WeakValueDictionary[bytes, Factor] = WeakValueDictionary()
"""Dict from the digest of a matrix and its vertices to the factor. An entry exists while a body in the process uses it.
"""


def factor_of(matrix: sparse.csc_matrix, points: Array) -> Factor:
    """Return the factor of a matrix (f, f); the factor of an equal matrix in the process is reused."""
    digest = hashlib.blake2b(str(matrix.shape).encode())
    for part in (matrix.indptr, matrix.indices, matrix.data, points):
        digest.update(np.ascontiguousarray(part).data)
    key = digest.digest()
    found = _MADE.get(key)
    if found is None:
        found = _MADE.setdefault(key, Factor(matrix, points))
    return found


SINGULAR = 1e-10
"""A rigid motion counts as having no stiffness if its eigenvalue of the Schur complement is below this fraction of the
largest eigenvalue.
"""

Solve = Callable[[Array], Array]


class Coupling(NamedTuple):
    """Data that extend a solve of the free vertices to the q rigid rows of handles with a free axis (`Unknowns`).

    Without such a handle, q is 0.

    Attributes:
        harmonic: (3 f, 3 q) matrix H. A column is the displacement of the free vertices that one component of the
            rigid rows causes, times -1.
        inverse_schur: (3 q, 3 q) inverse of the Schur complement S of the rigid rows. It is zero in the rows and
            columns of prescribed components.
        inverse: inverse of the free block A_ff, for the kernels.
        fixed: (k,) int64 components of the free rows that are constant (`Unknowns.fixed`).
    """

    harmonic: Array
    inverse_schur: Array
    inverse: Inverse
    fixed: NDArray[np.int64]


def eliminate_free(pulled: Array, motion: Array, solve: Solve) -> tuple[Array, Array, bool]:
    """Return H (3 f, 3 q), the inverse of S (3 q, 3 q), and whether S is positive semidefinite.

    Args:
        pulled: (3 f + 3 b, 3 q) product of a matrix and ``motion``: rows of free vertices, then of handles' vertices.
        motion: (3 b, 3 q) motion of the handles' vertices by the rigid rows (`rigid_motion`).
        solve: function that returns the solutions (3 f, k) with the free block for right-hand sides (3 f, k).
    """
    beside, within = np.split(pulled, [len(pulled) - len(motion)])
    harmonic = solve(beside)
    schur = motion.T @ within - beside.T @ harmonic
    return np.ascontiguousarray(harmonic), *pseudo_inverse(schur)


def pseudo_inverse(matrix: Array) -> tuple[Array, bool]:
    """Return the pseudo-inverse of a symmetric matrix (k, k), and whether the matrix is positive semidefinite.

    Eigenvalues whose magnitude is at most `SINGULAR` times the largest count as zero.
    """
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    least = SINGULAR * np.abs(values).max(initial=0.0)
    shares = np.divide(1.0, values, out=np.zeros_like(values), where=np.abs(values) > least)
    return np.ascontiguousarray(vectors * shares @ vectors.T), bool(values.min(initial=0.0) >= -least)


@kernel
def close_coupling(gradient, coupling, out):
    """Complete ``out`` (3 r,) to A^-1 ``gradient``; its rows of free vertices already contain A_ff^-1 gradient.

    Components that are constant become zero.
    """
    if len(coupling.inverse_schur):
        solve_rigid(coupling.harmonic, coupling.inverse_schur, gradient, out)
    clear_fixed(coupling.fixed, out)


def assemble(shape: ShapeOperators, weight: Array, hourglass: Array, count: int | None = None) -> sparse.csc_matrix:
    """Return the constant matrix (n, n) [N/m], sum_e w_e V_e g g^T + c_e sum_k gamma_k gamma_k^T.

    Each element e has the volume V_e, gradients g of its shape functions, and hourglass vectors gamma_k. For tetrahedra
    the matrix is sum_e w_e int g g^T dV.

    Args:
        shape: the elements.
        weight: w_e (m,) [Pa].
        hourglass: c_e (m,) [N/m].
        count: number n of vertices; None for the vertices of the elements.
    """
    return scatter(cell_type_of(shape).matrix_blocks(shape, weight, hourglass), shape.cells, count).tocsc()


def scatter(blocks: Array, nodes: NDArray[np.int32], count: int | None = None) -> sparse.coo_matrix:
    """Return the sum (n, n) of ``blocks`` (k, c, c), each between the vertices in a row of ``nodes`` (k, c).

    ``count`` is the number n of vertices; None stands for the largest index plus 1.
    """
    corners = nodes.shape[1]
    rows, columns = np.repeat(nodes, corners, axis=1).ravel(), np.tile(nodes, (1, corners)).ravel()
    size = None if count is None else (count, count)
    return sparse.coo_matrix((blocks.ravel(), (rows, columns)), shape=size)


class ConstantMatrix:
    """The constant matrix restricted to the unknowns, factored; one factor serves x, y and z.

    Handles with a free axis are eliminated by their Schur complement. One factor of the free vertices therefore serves
    all three axes, free or not. Vertices on rollers are free vertices with a spring; solutions are zero along the axes
    that the rollers fix.

    Args:
        matrix: the assembled matrix (n, n), symmetric.
        rest: (n, 3) rest vertices [m].
        unknowns: the numbering of the unknowns.

    Attributes:
        coupling: coupling of the handles in their rest poses to the free vertices.
        assembled: the matrix of all vertices (n, n).
    """

    ROLLING = 0.5
    """Stiffness of the spring at a vertex on rollers, divided by its diagonal entry. No equilibrium depends on it."""

    def __init__(self, matrix: sparse.csc_matrix, rest: Array, unknowns: Unknowns) -> None:
        self.assembled, self._unknowns = matrix, unknowns
        free = unknowns.free
        rows = matrix[free]
        block = rows[:, free].tocsc()
        if len(unknowns.fixed):  # without it, rollers alone would hold nothing
            rolling = np.unique(unknowns.fixed // 3)
            block = block + sparse.csc_matrix(
                (self.ROLLING * block.diagonal()[rolling], (rolling, rolling)), block.shape
            )
        self._prescribed = rows[:, unknowns.prescribed].tocsr()
        self._factor = factor_of(block, rest[free])
        frame = HandlePositions(rest, handle_centres(rest, unknowns))
        self._motion = rigid_motion(np.zeros(3 * unknowns.rows), frame, unknowns)
        moving, columns = np.concatenate([free, unknowns.members]), self._motion.shape[1]
        pulled = matrix[moving][:, unknowns.members] @ self._motion.reshape(len(unknowns.members), 3 * columns)
        pulled = pulled.reshape(3 * len(moving), columns)
        harmonic, schur, _ = eliminate_free(pulled, self._motion, self._solve_columns)
        self.coupling = Coupling(harmonic, schur, self._factor.inverse, unknowns.fixed)

    def solve(self, right: Array, out: Array) -> None:
        """Solve A_ff out = right for three right-hand sides (f, 3) to double precision."""
        self._factor.solve(right, out)
        out.reshape(-1)[self._unknowns.fixed] = 0.0

    def _solve_columns(self, right: Array) -> Array:
        """Return the solutions (3 f, k) of A_ff for k right-hand sides (3 f, k)."""
        found = np.empty((right.shape[1], len(self._unknowns.free), 3))
        for column, out in zip(np.ascontiguousarray(right.T), found, strict=True):
            self.solve(column.reshape(-1, 3), out)
        return np.ascontiguousarray(found.reshape(right.shape[::-1]).T)

    def multiply(self, motion: Array) -> Array:
        """Return the product A_ff ``motion`` (f, 3) for a motion of the free vertices."""
        free = self._unknowns.free
        whole = np.zeros((self.assembled.shape[0], 3))
        whole[free] = motion
        return (self.assembled @ whole)[free]

    def compliance(self, force: Array) -> float:
        """Return f . A^-1 f for vertex forces f (n, 3): a compliance, in m/N times the squared unit of f."""
        right, free = generalise(force, self._unknowns, self._motion), 3 * len(self._unknowns.free)
        out = np.zeros_like(right)
        self.solve(right[:free].reshape(-1, 3), out[:free].reshape(-1, 3))
        close_coupling(right, self.coupling, out)
        return float(right @ out)

    def extend(self, motion: Array) -> Array:
        """Return the harmonic extension (f, 3) [m] of a ``motion`` (b, 3) [m] of the prescribed vertices."""
        right = np.ascontiguousarray(-(self._prescribed @ motion))
        out = np.empty_like(right)
        self.solve(right, out)
        return out


@vector_kernel
def apply_inverse(gradient, coupling, out):
    """Write A^-1 gradient (3 r,) to ``out``, including the rigid rows."""
    apply_free(coupling.inverse, gradient, out)
    close_coupling(gradient, coupling, out)
