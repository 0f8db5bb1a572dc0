# SPDX-License-Identifier: Apache-2.0
"""The constant global matrix: one n x n system for x, y and z, factored once (Sec. 3.2)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.compiled import vector_kernel
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.elements.cell_type import cell_type_of
from gdfe_ros.solver.matrix.coupling import close_coupling, couple, rigid_motion
from gdfe_ros.solver.matrix.factor import Factorisation, factor_of, usual_kind
from gdfe_ros.solver.matrix.inverse import apply_free
from gdfe_ros.solver.matrix.unknowns import Unknowns


def assemble(
    shape: ShapeOperators, weight: NDArray[np.float64], hourglass: NDArray[np.float64], count: int | None = None
) -> sparse.csc_matrix:
    """Return the constant matrix (n, n) [N/m], sum_e w_e V_e g g^T + c_e sum_k gamma_k gamma_k^T.

    Each element e has the volume V_e, gradients g of its shape functions, and hourglass vectors gamma_k. For tetrahedra
    the matrix is sum_e w_e int g g^T dV.

    Args:
        shape: the elements.
        weight: w_e (m,) [Pa].
        hourglass: c_e (m,) [N/m].
        count: number n of vertices; None for the vertices of the elements.
    """
    return scattered(cell_type_of(shape).matrix_blocks(shape, weight, hourglass), shape.cells, count).tocsc()


def scattered(blocks: NDArray[np.float64], nodes: NDArray[np.int32], count: int | None = None) -> sparse.coo_matrix:
    """Return the sum (n, n) of ``blocks`` (k, c, c), each between the vertices of one row of ``nodes`` (k, c).

    ``count`` is the number n of vertices; None for the largest vertex of ``nodes``.
    """
    corners = nodes.shape[1]
    rows, columns = np.repeat(nodes, corners, axis=1).ravel(), np.tile(nodes, (1, corners)).ravel()
    size = None if count is None else (count, count)
    return sparse.coo_matrix((blocks.ravel(), (rows, columns)), shape=size)


class ConstantMatrix:
    """The constant matrix restricted to the unknowns, factored; one factor serves x, y and z.

    Handles with a free axis are eliminated by their Schur complement. One factor of the free vertices therefore serves
    all three axes, free or not. Vertices on rollers are free vertices with a spring; solutions are zero along the axes
    along which rollers hold them.

    Args:
        matrix: the assembled matrix (n, n), symmetric.
        rest: (n, 3) rest vertices [m].
        unknowns: the numbering of the unknowns.
        library: library that factors the matrix; None chooses by size.

    Attributes:
        kind: the library in use.
        coupling: coupling of the handles in their rest poses to the free vertices.
        assembled: the matrix of all vertices (n, n).
    """

    ROLLING = 0.5
    """Stiffness of the spring at a vertex on rollers over the vertex' diagonal entry. No equilibrium depends on it."""

    def __init__(
        self,
        matrix: sparse.csc_matrix,
        rest: NDArray[np.float64],
        unknowns: Unknowns,
        *,
        library: Factorisation | None = None,
    ) -> None:
        self.assembled, self._rest, self._unknowns = matrix, rest, unknowns
        free = unknowns.free
        rows = matrix[free]
        block = rows[:, free].tocsc()
        if len(unknowns.fixed):  # without it, rollers alone would hold nothing
            rolling = np.unique(unknowns.fixed // 3)
            block = block + sparse.csc_matrix(
                (self.ROLLING * block.diagonal()[rolling], (rolling, rolling)), block.shape
            )
        self._prescribed = rows[:, unknowns.prescribed].tocsr()
        self._factor = factor_of(block, rest[free], library or usual_kind(len(free)))
        self.kind = self._factor.kind
        self.coupling = couple(matrix, rest, unknowns, self.solve_exactly, self._factor.inverse)

    def solve(self, right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Solve A_ff out = right for three right-hand sides (f, 3), with a relative error up to `factor.SOUND`."""
        self._factor.solve(right, out)
        out.reshape(-1)[self._unknowns.fixed] = 0.0

    def solve_exactly(self, right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Solve A_ff out = right to double precision."""
        self._factor.solve(right, out, exact=True)
        out.reshape(-1)[self._unknowns.fixed] = 0.0

    def multiply(self, motion: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the product A_ff ``motion`` (f, 3) for a motion of the free vertices."""
        free = self._unknowns.free
        whole = np.zeros((self.assembled.shape[0], 3))
        whole[free] = motion
        return (self.assembled @ whole)[free]

    def compliance(self, force: NDArray[np.float64]) -> float:
        """Return the compliance f . A^-1 f of vertex forces f (n, 3); its unit is m/N times the squared unit of f."""
        unknowns, count = self._unknowns, len(self._unknowns.free)
        right = np.zeros((unknowns.rows, 3))
        right[:count] = force[unknowns.free]
        right.reshape(-1)[unknowns.fixed] = 0.0
        motion = rigid_motion(self._rest, unknowns)
        right[count:] = np.einsum("mia,mi->a", motion, force[unknowns.members]).reshape(-1, 3)
        out = np.zeros_like(right)
        self.solve_exactly(right[:count], out[:count])
        close_coupling(right.reshape(-1), self.coupling, out.reshape(-1))
        return float(np.vdot(right, out))

    def extend(self, motion: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the harmonic extension (f, 3) [m] of a ``motion`` (b, 3) [m] of the prescribed vertices."""
        right = np.ascontiguousarray(-(self._prescribed @ motion))
        out = np.empty_like(right)
        self.solve_exactly(right, out)
        return out


@vector_kernel
def apply_inverse(gradient, coupling, out, threads):
    """Write A^-1 gradient (3 r,) to ``out``, including the rigid rows; ``threads`` as in `apply_free`."""
    apply_free(coupling.inverse, gradient, out, threads)
    close_coupling(gradient, coupling, out)
