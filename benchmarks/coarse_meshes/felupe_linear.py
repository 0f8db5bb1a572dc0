# SPDX-License-Identifier: Apache-2.0
"""FElupe on a problem: its initial stiffness, of trilinear hexahedra with mean dilatation (Q1P0); a fine reference."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.coarse_meshes.linear import displaced
from benchmarks.coarse_meshes.problem import YOUNG, Found, Problem
from benchmarks.grids import Grid


def solve(problem: Problem) -> Found:
    """Return the solution with Q1P0."""
    import felupe

    mesh = felupe.Mesh(problem.mesh.vertices, problem.mesh.cells, "hexahedron")
    stiffness = _stiffness(felupe, felupe.RegionHexahedron(mesh), problem.poisson)
    given, moved = problem.prescribed()
    forces = np.zeros(problem.mesh.vertices.size) if problem.forces is None else problem.forces.ravel()
    displacement = displaced(stiffness, given, moved, forces)
    pull = stiffness @ displacement - forces
    return problem.found(displacement.reshape(-1, 3), pull.reshape(-1, 3))


def pad_modulus(cells: int, width: float, poisson: float) -> float:
    """Return mean stress over E times mean strain of a bonded pad, with triquadratic hexahedra on an eighth of it.

    Args:
        cells: over half of the height, and twice as many over half of the width, finer towards the bonded edge.
        width: of the pad over its height.
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
    """Return the initial stiffness, with the volume kept by a pressure in each cell."""
    field = felupe.FieldContainer([felupe.Field(region, dim=3)])
    law = felupe.NeoHooke(mu=YOUNG / (2.0 * (1.0 + poisson)))
    solid = felupe.SolidBodyNearlyIncompressible(law, field, bulk=YOUNG / (3.0 * (1.0 - 2.0 * poisson)))
    return solid.assemble.matrix().tocsr()
