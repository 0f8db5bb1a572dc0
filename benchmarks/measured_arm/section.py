# SPDX-License-Identifier: Apache-2.0
"""The arm's cross-section as quadrilaterals, and the hexahedra along it (Dubied et al. 2022, dimensions in metres).

Four chambers are between a round wall and a square core, whose corners are on the axes. Partitions along the axes
separate them. In the solid parts of the arm, the chambers are filled.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
OUTER, WALL, CORE, CORE_WALL = 22.22e-3, 2.03e-3, 10.11e-3, 2.27e-3
LENGTH, SOLID_END, LID = 102e-3, 6.93e-3, 3e-3
"""Free length of the arm, length of its solid end, and thickness of the lid on the chambers at the clamped end."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """The unpublished dimensions of the arm's section, and its numbers of cells.

    Attributes:
        partition: thickness of the partitions [m].
        hollow: whether the core is a tube.
        around: number of cells along a chamber's wall.
        along: number of layers of cells along the chambers.
    """

    partition: float = 2e-3
    hollow: bool = False
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

    def outline(self) -> Array:
        """Return the vertices of the round wall (k, 2) [m]; the last one is the first one again."""
        first = np.arcsin(0.5 * self.partition / (OUTER - WALL))
        angles = np.array([0.0, *np.linspace(first, 0.5 * np.pi - first, self.around + 1)])
        turns = np.append((angles + 0.5 * np.pi * np.arange(4)[:, None]).ravel(), 0.0)
        return OUTER * np.column_stack([np.cos(turns), np.sin(turns)])

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
        if not self.hollow:
            whole[0] += _filled(shrunk, turn)
        return whole[0], whole[1]


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
