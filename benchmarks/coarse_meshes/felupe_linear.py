# SPDX-License-Identifier: Apache-2.0
"""FElupe's solution of a `Problem` with Q1P0 elements (mean dilatation), and a fine reference of the pad."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.coarse_meshes.linear import displaced
from benchmarks.coarse_meshes.problem import YOUNG, Found, Problem
from benchmarks.grids import Grid


def solve(problem: Problem) -> Found:
    """Return FElupe's linear solution of a problem with Q1P0 elements."""
    import felupe

    mesh = felupe.Mesh(problem.mesh.vertices, problem.mesh.cells, "hexahedron")
    stiffness = _stiffness(felupe, felupe.RegionHexahedron(mesh), problem.poisson)
    given, moved = problem.prescribed()
    forces = np.zeros(problem.mesh.vertices.size) if problem.forces is None else problem.forces.ravel()
    displacement = displaced(stiffness, given, moved, forces)
    pull = stiffness @ displacement - forces
    return problem.found(displacement.reshape(-1, 3), pull.reshape(-1, 3))


def pad_modulus(cells: int, width: float, poisson: float) -> float:
    """Return mean stress / (E * mean strain) of a bonded pad, from triquadratic hexahedra on an eighth of the pad.

    Args:
        cells: number of cells over half of the height. Over half of the width there are twice as many; they are smaller
            towards the edge of the bonded face.
        width: width of the pad divided by its height.
        poisson: Poisson's ratio.
    """
    import felupe

    grid, half = Grid(size=(1.0, 1.0, 1.0), cells=(2 * cells, 2 * cells, cells), order=2), np.array([width, width, 1.0])
    points = np.add(grid.points(), (0.0, 0.5, 0.5))
    for axis, count in enumerate(grid.cells):
        even = np.linspace(0.0, 1.0, count + 1)
        points[:, axis] = 0.5 * half[axis] * np.interp(points[:, axis], even, 1.0 - (1.0 - even) ** 2)
    element = felupe.TriQuadraticHexahedron()
    mesh = felupe.Mesh(points, grid.connectivity(element.points), "hexahedron27")
    field = felupe.FieldContainer([felupe.Field(felupe.RegionTriQuadraticHexahedron(mesh), dim=3)])
    stiffness = felupe.SolidBody(felupe.LinearElastic(E=YOUNG, nu=poisson), field).assemble.matrix().tocsr()
    mirrored, bonded = points < 1e-12, np.isclose(points[:, 2], 0.5)
    moved = np.where(bonded[:, None], (0.0, 0.0, -0.5), 0.0).ravel()
    given = np.flatnonzero(mirrored | bonded[:, None])
    displacement = displaced(stiffness, given, moved[given], np.zeros(points.size))
    return float(displacement @ (stiffness @ displacement) / (YOUNG * np.prod(0.5 * half)))


def _stiffness(felupe: Any, region: Any, poisson: float) -> Any:
    """Return the initial stiffness (k, k) [N/m] of elements with one pressure per cell."""
    field = felupe.FieldContainer([felupe.Field(region, dim=3)])
    law = felupe.NeoHooke(mu=YOUNG / (2.0 * (1.0 + poisson)))
    solid = felupe.SolidBodyNearlyIncompressible(law, field, bulk=YOUNG / (3.0 * (1.0 - 2.0 * poisson)))
    return solid.assemble.matrix().tocsr()
