# SPDX-License-Identifier: Apache-2.0
"""A robot with a pressure chamber in FElupe: the scene's mesh with quadratic (20-node) hexahedra.

FElupe (GPL-3) is imported inside the function, because this package needs it only for its benchmark. Trilinear
hexahedra would lock in walls that are one cell thick. The units are mm, N and MPa, as in `peers.felupe_model`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from gdfe_ros.actuators import Chamber
from gdfe_ros.scene import Scene

MILLIMETRES, MEGAPASCALS = 1e3, 1e-6
LONGEST_INCREMENT, SHORTEST_INCREMENT = 1e3, 0.1
"""First increment of the pressure [Pa], and the increment below which the solution fails."""
SAME = 1e-4
"""Distance [mm] below which two points are the same point."""


def solve_chamber(
    scene: Scene, chamber: Chamber, probe: str, pressures: NDArray[np.float64], *, solver: Any = spsolve
) -> NDArray[np.float64]:
    """Return the positions (k, 3) [m] of a probe at pressures (k,) [Pa], which increase from zero.

    Args:
        scene: scene with neo-Hookean materials and one fixed handle; its loads are left out.
        chamber: chamber with the pressures; all other chambers have no pressure.
        probe: name of the probe.
        pressures: ascending.
        solver: solver of the linear systems, such as ``scipy.sparse.linalg.spsolve``; ``pypardiso.spsolve`` is far
            faster.
    """
    import felupe

    mesh = felupe.Mesh(scene.mesh.vertices * MILLIMETRES, scene.mesh.cells, "hexahedron")
    mesh = felupe.mesh.add_midpoints_edges(mesh)
    field = felupe.FieldContainer([felupe.Field(felupe.RegionQuadraticHexahedron(mesh), dim=3)])
    walls = felupe.RegionQuadraticHexahedronBoundary(mesh, mask=_on_walls(scene, chamber, mesh.points))
    pressure = felupe.SolidBodyPressure(felupe.FieldContainer([felupe.Field(walls, dim=3)]))
    solid = felupe.SolidBody(_law(scene, felupe), field)
    held = _held(scene, mesh.points)
    boundaries = {"base": felupe.Boundary(field[0], mask=held)}
    walk = _Walk(felupe, solid, pressure, field, boundaries, solver)
    point, found = scene.probes[probe], []
    for value in pressures:
        walk.reach(value * MEGAPASCALS)
        moved = (mesh.points + field[0].values)[: scene.mesh.n_vertices] / MILLIMETRES
        found.append(point.at(moved)[0])
    return np.array(found)


class _Walk:
    """Load path of rising pressure [MPa]: Newton's method from extrapolated positions; failed increments are halved."""

    def __init__(self, felupe: Any, solid: Any, pressure: Any, field: Any, boundaries: Any, solver: Any) -> None:
        self._felupe, self._items, self._pressure, self._field = felupe, [solid, pressure], pressure, field
        dof0, dof1 = felupe.dof.partition(field, boundaries)
        self._held = {"dof0": dof0, "dof1": dof1, "ext0": felupe.dof.apply(field, boundaries, dof0)}
        self._solver = lambda matrix, right: solver(matrix.tocsr(), right)
        self._at, self._reach, self._last = 0.0, LONGEST_INCREMENT * MEGAPASCALS, np.zeros_like(field[0].values)
        self._rate = np.zeros_like(self._last)

    def reach(self, goal: float) -> None:
        """Increase the pressure to ``goal`` [MPa]."""
        while self._at < goal:
            step = min(self._reach, goal - self._at)
            values = self._field[0].values
            values[...] = self._last + step * self._rate
            self._pressure.update(self._at + step)
            try:
                self._felupe.newtonraphson(
                    items=self._items,
                    x0=self._field,
                    solver=self._solver,
                    tol=1e-6,
                    maxiter=12,
                    verbose=0,
                    **self._held,
                )
            except self._felupe.tools.NewtonConvergenceError:
                self._reach = 0.5 * step
                if self._reach < SHORTEST_INCREMENT * MEGAPASCALS:
                    raise
                continue
            values = self._field[0].values
            self._rate, self._last = (values - self._last) / step, values.copy()
            self._at += step
            self._reach *= 1.5


def _law(scene: Scene, felupe: Any) -> Any:
    materials = list(scene.materials.values())
    shear = np.array([material.shear0 for material in materials])
    poisson = np.array([material.poisson for material in materials])
    lame = 2.0 * shear * poisson / (1.0 - 2.0 * poisson)
    cells = scene.cell_material
    law = felupe.NeoHookeCompressible(mu=shear[cells] * MEGAPASCALS, lmbda=lame[cells] * MEGAPASCALS)
    law.chunksize = None  # parameters are arrays over the cells: FElupe must not cut the cells into chunks
    return law


def _on_walls(scene: Scene, chamber: Chamber, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether each of the ``points`` (n, 3) [mm] is a corner or edge midpoint of the chamber's faces, (n,)."""
    corners = scene.mesh.vertices[chamber.quads] * MILLIMETRES
    middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
    walls = cKDTree(np.concatenate([corners.reshape(-1, 3), middles.reshape(-1, 3)]))
    return walls.query(points)[0] < SAME


def _held(scene: Scene, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether each of the ``points`` (n, 3) [mm] is in the plane of the fixed handle, which is flat; (n,)."""
    held = scene.mesh.vertices[scene.handles[0].vertices] * MILLIMETRES
    axis = int(np.ptp(held, axis=0).argmin())
    return np.abs(points[:, axis] - held[0, axis]) < SAME
