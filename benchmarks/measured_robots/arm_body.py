# SPDX-License-Identifier: Apache-2.0
"""The measured pneumatic arm: its recordings, its cross-section, mesh and scene (Dubied et al. 2022, in metres).

Four chambers are between a round wall and a square core, whose corners are on the axes. Partitions along the axes
separate them. In the solid parts of the arm, the chambers are filled.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from benchmarks.measured_robots import ROBOTS
from benchmarks.scenes import read_scene
from gdfe_ros import Command, Simulation
from gdfe_ros.scene import Scene, scene_from_text

Array = NDArray[np.float64]
MBAR, YOUNG = 100.0, 263824.0
"""One millibar [Pa], and the authors' modulus [Pa]."""
OUTER, WALL, CORE, CORE_WALL = 22.22e-3, 2.03e-3, 10.11e-3, 2.27e-3
LENGTH, SOLID_END, LID = 102e-3, 6.93e-3, 3e-3
"""Free length of the arm, length of its solid end, and thickness of the lid on the chambers at the clamped end."""
MARKED = 21e-3
"""Radius at which the markers are on the end face [m]."""
PLACE = float(0.6 * OUTER / np.sqrt(2.0))
"""x and y of a point in the first chamber [m]."""


def recorded() -> dict[str, NDArray[np.float64]]:
    """Return the recorded pressure [Pa], axial, lateral and total displacement [m] and tilt [rad], (k,) each."""
    rows = np.genfromtxt(ROBOTS.parent / "arm_pressure.csv", delimiter=",", skip_header=2)[:, 1:]
    scales = {"pressure": MBAR, "axial": 1e-3, "lateral": 1e-3, "total": 1e-3, "tilt": np.pi / 180.0}
    return {name: scale * column for (name, scale), column in zip(scales.items(), rows.T, strict=True)}


@dataclass(frozen=True, kw_only=True)
class Section:
    """The unpublished dimension of the arm's section, and its numbers of cells.

    Attributes:
        partition: thickness of the partitions [m].
        around: number of cells along a chamber's wall.
        along: number of layers of cells along the chambers.
    """

    partition: float = 2e-3
    around: int = 4
    along: int = 14

    def hexahedra(self) -> tuple[Array, NDArray[np.int64]]:
        """Return vertices (n, 3) [m] and cells (m, 8) of the arm, from its lid (z < 0) to its end at z = `LENGTH`."""
        wall, chambers = self._quads()
        levels = [-LID, *np.linspace(0.0, LENGTH - SOLID_END, self.along + 1), LENGTH]
        points, cells = [], []
        for layer, (z0, z1) in enumerate(pairwise(levels)):
            solid = layer in (0, len(levels) - 2)
            for quad in [*wall, *(chambers if solid else [])]:
                corners = [np.append(corner, z) for z in (z0, z1) for corner in quad]
                cells.append(range(len(points), len(points) + 8))
                points += corners
        rounded, order = np.unique(np.round(points, 9), axis=0, return_inverse=True)
        return rounded, order.ravel()[np.array(cells)]

    def _quads(self) -> tuple[list[Array], list[Array]]:
        """Return the corners (4, 2) [m] of the quadrilaterals of the walls and of the chambers, counter-clockwise."""
        wall, chambers, turn = [], [], np.array([[0.0, -1.0], [1.0, 0.0]])
        half, inner, n = 0.5 * self.partition, OUTER - WALL, self.around
        first = np.arcsin(half / inner)
        angles = np.linspace(first, 0.5 * np.pi - first, n + 1)
        ring = inner * np.column_stack([np.cos(angles), np.sin(angles)])
        core = np.linspace([CORE - half, half], [half, CORE - half], n + 1)
        before, after = np.array([inner, 0.0]), np.array([0.0, inner])
        low, high = np.array([CORE, 0.0]), np.array([0.0, CORE])
        ring, core = np.vstack([before, ring, after]), np.vstack([low, core, high])
        outside = OUTER * ring / np.linalg.norm(ring, axis=1)[:, None]
        shrunk = (1.0 - np.sqrt(2.0) * CORE_WALL / CORE) * core
        for i in range(n + 2):
            wall.append(np.array([ring[i], outside[i], outside[i + 1], ring[i + 1]]))
            wall.append(np.array([shrunk[i], core[i], core[i + 1], shrunk[i + 1]]))
            between = np.linspace(core[i], ring[i], 5), np.linspace(core[i + 1], ring[i + 1], 5)
            for j in range(4):
                quad = np.array([between[0][j], between[0][j + 1], between[1][j + 1], between[1][j]])
                (wall if i in (0, n + 1) else chambers).append(quad)
        parts = [wall, chambers]
        whole = [[q @ np.linalg.matrix_power(turn, k).T for k in range(4) for q in part] for part in parts]
        return whole[0] + _filled(shrunk, turn), whole[1]


def _filled(side: Array, turn: Array) -> list[Array]:
    """Return quadrilaterals inside four sides (Coons patch); each side is the previous one rotated by 90 degrees."""
    sides = [side @ np.linalg.matrix_power(turn, k).T for k in range(4)]
    bottom, right, top, left = sides[0], sides[1], sides[2][::-1], sides[3][::-1]
    t = np.linspace(0.0, 1.0, len(side))
    u, v = t[None, :, None], t[:, None, None]
    grid = (1 - v) * bottom[None] + v * top[None] + (1 - u) * left[:, None] + u * right[:, None]
    grid -= (1 - u) * (1 - v) * bottom[0] + u * (1 - v) * bottom[-1] + (1 - u) * v * top[0] + u * v * top[-1]
    count = len(side) - 1
    return [
        np.array([grid[i, j], grid[i, j + 1], grid[i + 1, j + 1], grid[i + 1, j]])
        for i in range(count)
        for j in range(count)
    ]


def arm_scene(
    folder: Path,
    section: Section,
    material: dict[str, Any],
    *,
    dynamics: dict[str, Any] | None = None,
    gravity: float = 9.81,
) -> Scene:
    """Return the scene of the arm, which hangs along z. Its first chamber has the actuator ``air``.

    Args:
        folder: folder into which the mesh is written.
        section: cross-section of the arm.
        material: material law, as in a scene file.
        dynamics: time steps and damping, as in a scene file; None for equilibria.
        gravity: acceleration along the hanging arm [m/s^2]; 0 for an arm that is at rest in its drawn shape.
    """
    points, cells = section.hexahedra()
    file = folder / f"arm_{abs(hash(section)):x}.vtu"
    meshio.write(file, meshio.Mesh(points, [("hexahedron", cells)]))
    given = {
        "mesh.file": str(file),
        "materials": {"silicone": material},
        "actuators.air.chamber.near": [PLACE, PLACE, 0.5 * LENGTH],
        "loads.weight.gravity": [0.0, 0.0, gravity],
        "probes": {f"mark{k}": _mark(k) for k in range(4)},
        **({"dynamics": dynamics} if dynamics else {}),
    }
    return scene_from_text(read_scene("measured_arm.yaml"), origin="of the measured arm", overrides=given)


def tips(scene: Scene, *, step: float, most: float) -> NDArray[np.float64]:
    """Return pressure in the first chamber [Pa], total displacement [m] and tilt [rad] of the tip, (k, 3).

    The rows end with the last equilibrium.

    Args:
        scene: scene of the arm, with the chamber ``air_1``.
        step: increment of the pressure [Pa].
        most: largest pressure [Pa].
    """
    simulation, found = Simulation(scene), [[0.0, 0.0, 0.0]]
    simulation.step()
    rest = marks(simulation)
    for pressure in np.arange(step, most + 0.5 * step, step):
        result = simulation.step(Command(actuators={"air_1": float(pressure)}))
        if not result.converged or result.min_det <= 0.0:
            break
        now = marks(simulation)
        normal = np.cross(now[2] - now[0], now[3] - now[1])
        tilt = np.arccos(abs(normal[2]) / np.linalg.norm(normal))
        found.append([pressure, float(np.linalg.norm((now - rest).mean(axis=0))), tilt])
    return np.array(found)


def marks(simulation: Simulation) -> NDArray[np.float64]:
    """Return the positions (4, 3) [m] of the markers on the free end."""
    places = simulation.probe_positions()
    return np.array([places[f"mark{k}"] for k in range(4)])


def _mark(k: int) -> list[float]:
    angle = 0.5 * np.pi * k
    return [float(MARKED * np.cos(angle)), float(MARKED * np.sin(angle)), LENGTH]
