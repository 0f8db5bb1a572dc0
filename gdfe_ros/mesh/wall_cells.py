# SPDX-License-Identifier: Apache-2.0
"""Walls of a mesh of tetrahedra that are much thinner than the cells are long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.tet_faces import facets
from gdfe_ros.mesh.tetmesh import TetMesh
from gdfe_ros.mesh.walls import Walls, thickness_at

FLATTEST = 4.0
"""Edge of a cell along a wall, divided by the wall's thickness, above which the wall is too stiff in bending. A clamped
strip, 20 times as wide as thick, with one cell through its thickness was 1 % too stiff at a ratio of 2.8, 6 % at 4.0,
15 % at 5.7, and 25 % at 7.1.
"""
LEAST_FRACTION = 0.01
"""Least fraction of the surface for a remark on flat cells. At a sharp edge, the last cells are always flat."""


def measured(ratio: float) -> str:
    """Return a text about the error of walls whose cells are ``ratio`` times as long as the wall is thick."""
    return (
        f"Edges of cells there are up to {ratio:.2g} times as long as the wall is thick. Measured on a clamped strip "
        "20 times as wide as thick: 6 % too stiff at 4 times, 15 % at 5.7, 25 % at 7. One cell through the thickness "
        "is enough"
    )


def flat_walls(mesh: TetMesh) -> list[str]:
    """Return a list with a remark on walls whose cells are too long for their thickness; empty if there are none."""
    cells = wall_cells(mesh)
    fraction = cells.walls.fraction(cells.flatness > FLATTEST)
    if fraction < LEAST_FRACTION:
        return []
    worst = int(np.argmax(cells.flatness))
    thickness, (x, y, z) = cells.walls.thickness[worst], cells.walls.places[worst]
    return [
        f"{fraction:.0%} of the surface is at walls that are thin for their cells, the worst {thickness:.3g} m thick "
        f"near ({x:.4g}, {y:.4g}, {z:.4g}) m. {measured(float(cells.flatness[worst]))}; remedy: a smaller `size`, or "
        f"`least_size: {thickness:.2g}` beside `size`, which makes small cells only at thin walls"
    ]


@dataclass(frozen=True, eq=False)
class WallCells:
    """The thickness of a mesh's walls beside the length of its cells.

    Attributes:
        walls: thickness at the facets of the mesh's boundary; a six-node face has four facets.
        edges: (k,) [m], longest edge of the face to which each facet belongs.
    """

    walls: Walls
    edges: NDArray[np.float64]

    @property
    def flatness(self) -> NDArray[np.float64]:
        """Edge divided by the thickness of the wall, (k,); zero where there is no wall."""
        return self.edges / self.walls.thickness


def wall_cells(mesh: TetMesh) -> WallCells:
    """Return the thickness of the walls of a mesh of tetrahedra beside the length of its cells."""
    faces, vertices = mesh.boundary.quads, mesh.vertices
    corners = vertices[faces[:, :3]]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    triangles = facets(faces)
    walls, kept = thickness_at(vertices[triangles], vertices, triangles)
    return WallCells(walls, np.repeat(edges, 4)[kept])
