# SPDX-License-Identifier: Apache-2.0
"""The finite elements of the fine references in FElupe: Q2/P1 with condensed cell fields.

Triquadratic hexahedra are stable near incompressibility if pressure and volume ratio are linear in
each cell and discontinuous between cells. These two cell fields are condensed, so that the linear
systems have only displacements as unknowns.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse

from benchmarks.cases import Case, LogNeoHooke
from benchmarks.grids import Grid
from benchmarks.peers import felupe_model as fm

Array = npt.NDArray[np.float64]

TIE = 1e4
"""Penalty of the tied handle [N/mm]."""
_MODES = 4
"""Number of unknowns of a linear field in a cell: the value and three slopes."""


class CellwiseOgden:
    """The isochoric Ogden laws of a bar's segments, each evaluated on the cells of its segment (a FElupe material)."""

    def __init__(self, case: Case, grid: Grid) -> None:
        self._cell_law = case.cell_law(grid)
        self._materials = [fm.ogden_material(law) for law in case.laws]
        self.x = self._materials[0].x

    def gradient(self, x: list[Array]) -> list[Array]:
        """Return the first Piola-Kirchhoff stress, shape (3, 3, q, m) [MPa], and the state, which is unused."""
        return [self._evaluate(x, "gradient", np.empty_like(x[0])), x[1]]

    def hessian(self, x: list[Array]) -> list[Array]:
        """Return the derivative of this stress with respect to F, shape (3, 3, 3, 3, q, m) [MPa]."""
        return [self._evaluate(x, "hessian", np.empty((3, 3, *x[0].shape)))]

    def _evaluate(self, x: list[Array], method: str, out: Array) -> Array:
        for index, material in enumerate(self._materials):
            own = self._cell_law == index
            out[..., own] = getattr(material, method)([np.ascontiguousarray(x[0][..., own]), x[1]])[0]
        return out


def build_model(case: Case, grid: Grid) -> fm.Model:
    """Return the Q2/P1 model of a bar."""
    import felupe

    region = fm.build_mesh(grid, felupe)
    cell_region = linear_cell_region(felupe, region, grid.n_cells)
    unit = np.zeros((_MODES * grid.n_cells, 1))
    unit[::_MODES] = 1.0
    fields = [felupe.Field(region, dim=3), felupe.Field(cell_region), felupe.Field(cell_region, values=unit)]
    field = felupe.FieldContainer(fields)
    if isinstance(case.laws[0], LogNeoHooke):
        material = fm.log_material(case, grid, felupe)
    else:
        bulk = np.array([law.bulk for law in case.laws])[case.cell_law(grid)] * fm.MEGAPASCALS
        material = felupe.NearlyIncompressible(CellwiseOgden(case, grid), bulk=bulk)
        material.chunksize = None
    items = [felupe.SolidBody(material, field)]
    if case.slides:
        items.append(fm.tie_handle(grid, field, felupe, multiplier=TIE))
    boundaries = fm.build_boundaries(case, grid, field[0], felupe)
    return fm.Model(felupe=felupe, grid=grid, field=field, items=items, boundaries=boundaries, slides=case.slides)


def linear_cell_region(felupe: ModuleType, region: Any, n_cells: int) -> Any:
    """Return a region whose fields are 1, r, s, t in each cell, discontinuous between cells."""

    class Linear(felupe.Element):
        """A FElupe element with the shape functions 1, r, s, t."""

        def __init__(self) -> None:
            self.points = np.zeros((_MODES, 3))
            self.cells = np.arange(_MODES).reshape(1, -1)
            self.cell_type = "tetra"
            self.shape = self.points.shape

        def function(self, rst: Array) -> Array:
            return np.array([1.0, *rst])

        def gradient(self, rst: Array) -> Array:
            return np.vstack([np.zeros(3), np.eye(3)])

    count = _MODES * n_cells
    mesh = felupe.Mesh(np.zeros((count, 3)), np.arange(count).reshape(-1, _MODES), "tetra")
    return felupe.Region(mesh, Linear(), region.quadrature, grad=False)


def condensed_solve(grid: Grid, factor: Callable[[Any, Array], Array]) -> Callable[..., Array]:
    """Return a replacement for FElupe's ``solve`` that eliminates the cell fields p and J.

    With blocks ``K_pJ = M`` (invertible cell by cell), ``K_JJ = H`` and ``K_pp = K_uJ = 0``:
    ``dJ = -M^-1 (r_p + K_pu du)``, ``dp = -M^-T (r_J + H dJ)`` and
    ``(K_uu + K_up M^-T H M^-1 K_pu) du = -r_u + K_up M^-T (r_J - H M^-1 r_p)``.

    Args:
        grid: lattice of the displacement nodes.
        factor: function ``(A, b) -> x`` that solves a symmetric sparse system.
    """
    n_u, n_p = 3 * len(grid.points()), _MODES * grid.n_cells
    cut = [n_u, n_u + n_p]

    def solve(K: Any, b: Array, x: Any, dof1: Any, dof0: Any, ext0: Array) -> Array:
        matrix = K.tocsr()
        k_uu, k_up = matrix[:n_u, :n_u], matrix[:n_u, cut[0] : cut[1]]
        inverse = invert_blocks(matrix[cut[0] : cut[1], cut[1] :])
        bulk = matrix[cut[1] :, cut[1] :]
        r_u, r_p, r_j = np.split(-b, cut)
        condensed = (k_uu + k_up @ (inverse.T @ bulk @ inverse) @ k_up.T).tocsr()
        right = -r_u + k_up @ (inverse.T @ (r_j - bulk @ (inverse @ r_p)))
        values = np.concatenate([field.values.ravel() for field in x.fields])
        step, free = np.zeros(n_u), dof1[dof1 < n_u]
        step[dof0] = ext0 - values[dof0]
        rows = condensed[free]
        step[free] = factor(rows[:, free], right[free] - rows[:, dof0] @ step[dof0])
        step_j = -(inverse @ (r_p + k_up.T @ step))
        return np.concatenate([step, -(inverse.T @ (r_j + bulk @ step_j)), step_j])

    return solve


def invert_blocks(matrix: Any) -> Any:
    """Return the inverse of a sparse block-diagonal matrix with 4x4 blocks, as CSR."""
    blocks = np.array([[matrix[i::_MODES, j::_MODES].diagonal() for j in range(_MODES)] for i in range(_MODES)])
    inverse = np.linalg.inv(blocks.transpose(2, 0, 1))
    count = len(inverse)
    return scipy.sparse.bsr_matrix((inverse, np.arange(count), np.arange(count + 1))).tocsr()


def strain_energy(case: Case, grid: Grid, result: Any) -> float:
    """Return the strain energy [J] of a Newton result: the integral of the laws' W over the quadrature points."""
    field = result.x
    gradient, _, ratio = field.extract()
    stretches = np.linalg.eigvalsh(np.einsum("ki...,kj...->...ij", gradient, gradient)) ** 0.5
    ratio = np.broadcast_to(ratio[0], stretches.shape[:-1])
    determinant = np.prod(stretches, axis=-1)
    volume = field.region.dV
    total, cell_law = 0.0, case.cell_law(grid)
    for index, law in enumerate(case.laws):
        own = cell_law == index
        lam, jac, mean = stretches[:, own], determinant[:, own], ratio[:, own]
        if isinstance(law, LogNeoHooke):
            density = law.mu / 2 * ((lam**2).sum(-1) - 3) - law.mu * np.log(jac) + law.lame / 2 * np.log(mean) ** 2
        else:
            isochoric = lam * jac[..., None] ** (-1 / 3)
            terms = zip(law.mu, law.alpha, strict=True)
            density = sum(2 * m / a**2 * ((isochoric**a).sum(-1) - 3) for m, a in terms)
            density = density + law.bulk / 2 * (mean - 1) ** 2
        total += float((density * volume[:, own]).sum())
    return total / fm.MILLIMETRES**3
