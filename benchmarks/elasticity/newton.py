# SPDX-License-Identifier: Apache-2.0
"""A projected Newton method on linear and quadratic tetrahedra, with numpy and the sparse Cholesky solver of MKL.

It is the plain method of the public benchmark, in its fastest form: all elements at once, one symbolic analysis, a
linear prediction as start, and the filter only where the true Hessian has no Cholesky factor.
"""

from __future__ import annotations

import time
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from benchmarks.elasticity import law
from benchmarks.elasticity.problem import DECREMENT, Array, Problem, run
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.cells.tetrahedra import CORNER_SLOPES, POINTS, quadratic_slopes
from gdfe_ros.mesh.tetmesh import corners_of_six, divide

MOST, ARMIJO = 100, 1e-4
"""Limit of iterations, and constant of the line search."""


@cache
def pardiso(definite: bool) -> Any:
    """Return PARDISO for symmetric matrices, positive definite or not; the search for the library takes a second."""
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver(mtype=2 if definite else -2)


class Cholesky:
    """Sparse factors of symmetric matrices, analysed once for each pattern, by PARDISO, or without it by SuperLU.

    Args:
        definite: whether a matrix that is not positive definite is refused.

    Attributes:
        name: the library.
        count: number of factors so far.
    """

    def __init__(self, *, definite: bool = True) -> None:
        self._pardiso = pardiso(definite) if find_spec("pypardiso") else None
        self.name, self.count, self._definite = "PARDISO" if self._pardiso else "SuperLU", 0, definite
        self._analysed: NDArray[np.int32] | None = None

    def solve(self, matrix: sparse.csr_matrix, right: Array) -> Array | None:
        """Return the solution (f,) for an upper triangle (f, f); None if the matrix is refused."""
        self.count += 1
        if self._pardiso is None:
            whole = (matrix + sparse.triu(matrix, 1).T).tocsc()
            factor = splu(whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
            return None if self._definite and (factor.U.diagonal() <= 0.0).any() else factor.solve(right)
        from pypardiso.pardiso_wrapper import PyPardisoError

        if self._analysed is None or not np.array_equal(self._analysed, matrix.indices):
            self._call(11, matrix, right)
            self._analysed = matrix.indices
        try:
            self._call(22, matrix, right)
        except PyPardisoError:
            return None
        return self._call(33, matrix, right)

    def _call(self, phase: int, matrix: sparse.csr_matrix, right: Array) -> Array:
        self._pardiso.set_phase(phase)
        return self._pardiso._call_pardiso(matrix, right)

    def close(self) -> None:
        """Free the memory of PARDISO."""
        if self._pardiso is not None:
            self._pardiso.free_memory(everything=True)


class Pattern:
    """The sums of element matrices into the upper triangle of the free unknowns.

    Args:
        rows: unknowns (m, f) of each element.
        free: the free unknowns (k,), sorted.
    """

    def __init__(self, rows: NDArray[np.int32], free: NDArray[np.intp]) -> None:
        number, self.size = np.full(rows.max() + 1, -1), len(free)
        number[free] = np.arange(self.size)
        local = number[rows]
        first, second = np.broadcast_arrays(local[:, :, None], local[:, None, :])
        self._kept = np.flatnonzero(((first >= 0) & (first <= second)).ravel())
        keys = first.ravel()[self._kept].astype(np.int64) * self.size + second.ravel()[self._kept]
        unique, self._slot = np.unique(keys, return_inverse=True)
        starts = np.searchsorted(unique, np.arange(self.size + 1, dtype=np.int64) * self.size)
        self._indices, self._starts = (unique % self.size).astype(np.int32), starts.astype(np.int32)

    def matrix(self, elements: Array) -> sparse.csr_matrix:
        """Return the upper triangle (k, k) of the sum of element matrices (m, f, f)."""
        data = np.bincount(self._slot, elements.ravel()[self._kept], minlength=len(self._indices))
        return sparse.csr_matrix((data, self._indices, self._starts), shape=(self.size, self.size))


class Tetrahedra:
    """The cube's mesh of linear (``order`` 1) or quadratic tetrahedra, six in each of n^3 cubes.

    Attributes:
        points: nodes (k, 3) [m].
        free: unknowns that are not held.
    """

    def __init__(self, n: int, order: int) -> None:
        grid = bar([1.0, 1.0, 1.0], [n, n, n])
        mesh = divide(grid) if order == 2 else None
        self.points, self.cells = (
            (mesh.vertices, mesh.cells) if mesh is not None else (grid.vertices, corners_of_six(grid.cells))
        )
        slopes = quadratic_slopes(POINTS) if order == 2 else CORNER_SLOPES[None]
        edges = np.einsum("ai,eaj->eji", CORNER_SLOPES, self.points[self.cells[:, :4]])
        count, places = len(self.cells), len(slopes)
        gradient = np.einsum("qak,ekj->eqaj", slopes, np.linalg.inv(edges))
        self.operator = np.einsum("eqaj,ik->eqijak", gradient, np.eye(3)).reshape(count, places, 9, -1)
        self.weight = np.broadcast_to(np.linalg.det(edges)[:, None] / 6.0 / places, (count, places))
        self.rows = (3 * self.cells[:, :, None] + np.arange(3)).reshape(count, -1)
        x = self.points[:, 0]
        self.held, self.far = (x < 1e-9) | (x > 1.0 - 1e-9), x > 1.0 - 1e-9
        self.free = np.flatnonzero(~np.repeat(self.held, 3))
        self.pattern = Pattern(self.rows, self.free)

    def gradients(self, u: Array) -> Array:
        """Return F (m, q, 9) for displacements (3 k,) [m]."""
        return law.IDENTITY + (self.operator @ u[self.rows][:, None, :, None])[..., 0]

    def energy(self, u: Array, problem: Problem) -> float:
        """Return the energy [J]."""
        return float((self.weight * law.density(self.gradients(u), problem.mu, problem.lame)).sum())

    def forces(self, stress: Array) -> Array:
        """Return dE/du (3 k,) [N] for stresses (m, q, 9) [Pa]."""
        local = np.einsum("eq,eqif,eqi->ef", self.weight, self.operator, stress, optimize=True)
        return np.bincount(self.rows.ravel(), local.ravel(), minlength=self.points.size)

    def elements(self, hessian: Array) -> Array:
        """Return the element matrices (m, f, f) [N/m] for dP/dF (m, q, 9, 9) [Pa]."""
        products = np.swapaxes(self.operator, -1, -2) @ (self.weight[..., None, None] * hessian) @ self.operator
        return products.sum(axis=1)


def minimise(body: Tetrahedra, problem: Problem, cholesky: Cholesky, u: Array) -> dict[str, Any]:
    """Minimise the energy from the displacements ``u`` (3 k,) [m] on, in place; return iterations and a message."""
    free, filtered = body.free, 0
    for iteration in range(1, MOST + 1):
        stress, hessian = law.tangent(body.gradients(u), problem.mu, problem.lame)
        force = body.forces(stress)[free]
        step = cholesky.solve(body.pattern.matrix(body.elements(hessian)), -force)
        if step is None:
            filtered += 1
            step = cholesky.solve(body.pattern.matrix(body.elements(law.positive_part(hessian))), -force)
        if step is None:
            return {"iterations": iteration, "filtered": filtered, "message": "the filtered Hessian has no factor"}
        decrement = -float(force @ step)
        start, energy, length = u[free].copy(), body.energy(u, problem), 1.0
        u[free] = start + step
        if decrement < DECREMENT * problem.mu:
            return {"iterations": iteration, "filtered": filtered, "message": "", "decrement": decrement / problem.mu}
        while not body.energy(u, problem) <= energy - ARMIJO * length * decrement:
            length *= 0.5
            u[free] = start + length * step
            if length < 1e-12:
                return {"iterations": iteration, "filtered": filtered, "message": "the line search failed"}
    return {"iterations": MOST, "filtered": filtered, "message": f"no convergence in {MOST} iterations"}


def solve(problem: Problem, n: int, order: int) -> dict[str, Any]:
    """Return the run of the Newton method on the cube's mesh of n^3 cubes (`problem.run`)."""
    cholesky = Cholesky()
    began = time.process_time()
    body = Tetrahedra(n, order)
    u = np.zeros((len(body.points), 3))
    u[body.far] = problem.moved(body.points[body.far])
    flat = u.reshape(-1)
    rest = body.elements(law.tangent(body.gradients(np.zeros_like(flat)), problem.mu, problem.lame)[1])
    pull = np.bincount(body.rows.ravel(), (rest @ flat[body.rows][..., None]).ravel(), minlength=flat.size)
    flat[body.free] = cholesky.solve(body.pattern.matrix(rest), -pull[body.free])
    found = minimise(body, problem, cholesky, flat)
    spent = time.process_time() - began
    cholesky.close()
    forces = body.forces(law.stress(body.gradients(flat), problem.mu, problem.lame)).reshape(-1, 3)
    return run(problem, body.points, u, forces, time=spent, solves=cholesky.count, steps=1, **found)
