# SPDX-License-Identifier: Apache-2.0
"""The benchmark bars in FElupe: regions, fields, materials and boundary conditions.

FElupe (GPL-3) is imported inside the functions, because this package needs it only for its benchmark.
The units are mm, N and MPa, because FElupe's tolerances need numbers that are not very small.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.cases import Case, LogNeoHooke
from benchmarks.grids import Grid

Array = npt.NDArray[np.float64]
MILLIMETRES = 1e3
"""Millimetres in a metre."""
MEGAPASCALS = 1e-6
"""Megapascals in a pascal."""
TIE = 1e3
"""Penalty of the tied handle [N/mm], 10^4 times the stiffness of a cell. It changes the mean error of
bend5 by less than 0.001 %."""


@dataclass(frozen=True, kw_only=True)
class Model:
    """FElupe model of a bar for Newton's method.

    Attributes:
        felupe: imported package.
        grid: lattice of nodes.
        field: FElupe's field container; displacements come first.
        items: FElupe's items: solid bodies and, for a sliding handle, the tie of its x displacements.
        boundaries: FElupe's boundaries ``left`` and ``right``.
        slides: whether the x displacements of the right face are equal and free instead of prescribed.
    """

    felupe: ModuleType
    grid: Grid
    field: Any
    items: list[Any]
    boundaries: dict[str, Any]
    slides: bool

    def prescribe(self, displacement: Array) -> None:
        """Set the displacement of the right face's nodes, shape (f, 3), float64 [m]."""
        columns = displacement[:, 1:] if self.slides else displacement
        self.boundaries["right"].update(columns.ravel() * MILLIMETRES)


def build_mesh(grid: Grid, felupe: ModuleType, *, unit: float = MILLIMETRES) -> Any:
    """Return FElupe's region of the grid with linear or triquadratic hexahedra; a metre has ``unit`` of its units."""
    quadratic = grid.order == 2
    element = felupe.TriQuadraticHexahedron() if quadratic else felupe.Hexahedron()
    cell_type = "hexahedron27" if quadratic else "hexahedron"
    mesh = felupe.Mesh(grid.points() * unit, grid.connectivity(element.points), cell_type)
    return felupe.RegionTriQuadraticHexahedron(mesh) if quadratic else felupe.RegionHexahedron(mesh)


def build_model(case: Case, grid: Grid) -> Model:
    """Return the model with FElupe's standard mixed formulations for mean dilatation.

    Neo-Hookean bars use `NearlyIncompressible` on the fields (u, p, J) with the volumetric function of
    the law. Ogden bars use one `SolidBodyNearlyIncompressible` for each segment; its fields (p, J) are
    condensed cell by cell.
    """
    import felupe

    region = build_mesh(grid, felupe)
    if isinstance(case.laws[0], LogNeoHooke):
        field = felupe.FieldsMixed(region, n=3)
        items = [felupe.SolidBody(log_material(case, grid, felupe), field)]
    else:
        field = felupe.FieldContainer([felupe.Field(region, dim=3)])
        items = [_ogden_body(case, grid, region, index, felupe) for index in range(len(case.laws))]
    boundaries = build_boundaries(grid, field[0], felupe, slides=case.slides)
    if case.slides:
        items.append(tie_handle(grid, field, felupe, multiplier=TIE))
    return Model(felupe=felupe, grid=grid, field=field, items=items, boundaries=boundaries, slides=case.slides)


def log_material(case: Case, grid: Grid, felupe: ModuleType) -> Any:
    """Return the logarithmic neo-Hookean law of all cells, with ``lame/2 (ln J)^2`` for the mean J of a cell."""
    cell_law = case.cell_law(grid)
    mu = np.array([law.mu for law in case.laws])[cell_law] * MEGAPASCALS
    lame = np.array([law.lame for law in case.laws])[cell_law] * MEGAPASCALS
    distortion = felupe.NeoHookeCompressible(mu=mu)
    material = felupe.NearlyIncompressible(
        distortion,
        bulk=lame,
        dUdJ=lambda ratio, lame: lame * np.log(ratio) / ratio,
        d2UdJdJ=lambda ratio, lame: lame * (1.0 - np.log(ratio)) / ratio**2,
    )
    # Parameters are arrays over the cells, so FElupe must not cut the cells into chunks.
    distortion.chunksize = material.chunksize = None
    return material


def _ogden_body(case: Case, grid: Grid, region: Any, index: int, felupe: ModuleType) -> Any:
    mesh = region.mesh
    cells = mesh.cells[case.cell_law(grid) == index]
    part = type(region)(felupe.Mesh(mesh.points, cells, mesh.cell_type))
    field = felupe.FieldContainer([felupe.Field(part, dim=3)])
    law = case.laws[index]
    return felupe.SolidBodyNearlyIncompressible(ogden_material(law), field, bulk=law.bulk * MEGAPASCALS)


def ogden_material(law: Any) -> Any:
    """Return the isochoric part of an Ogden law, differentiated automatically by FElupe."""
    from felupe.constitution import tensortrax

    return tensortrax.Hyperelastic(
        tensortrax.models.hyperelastic.ogden, mu=[mu * MEGAPASCALS for mu in law.mu], alpha=list(law.alpha)
    )


def build_boundaries(grid: Grid, displacement: Any, felupe: ModuleType, *, slides: bool = False) -> dict[str, Any]:
    """Return the boundaries of the clamped left and the moved right face."""
    masks = {"left": grid.face(right=False), "right": grid.face(right=True)}
    count = len(displacement.region.mesh.points)
    result = {}
    for name, nodes in masks.items():
        mask = np.zeros(count, dtype=bool)
        mask[nodes] = True
        skip = (1, 0, 0) if name == "right" and slides else (0, 0, 0)
        result[name] = felupe.Boundary(displacement, mask=mask, skip=skip)
    return result


def tie_handle(grid: Grid, field: Any, felupe: ModuleType, *, multiplier: float) -> Any:
    """Return the FElupe item that makes the x displacements of the right face equal."""
    face = grid.face(right=True)
    return felupe.MultiPointConstraint(
        field, points=face[1:], centerpoint=int(face[0]), skip=(0, 1, 1), multiplier=multiplier
    )
