# SPDX-License-Identifier: Apache-2.0
"""Rigid solids from closed surfaces: signed distances on a grid, negative inside."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.surfaces.shells import BoxTree, cone_volumes, points_inside, shells

CELLS = 64
"""Default number of grid cells along the longest edge of a solid's bounding box."""
MARGIN = 4
"""Number of grid cells outside of the bounding box, on each side."""
MOST_POINTS = 4_000_000
"""Limit of the number of grid points; more points need minutes and gigabytes of memory."""
VOLUME_ERROR = 0.3
"""The grid is too coarse if the volume of its inner points differs from the surface's volume by more than this
fraction.
"""


@dataclass(frozen=True, eq=False)
class Solid:
    """The solid inside a closed surface.

    Attributes:
        vertices: (n, 3) float64 [m], vertices of the surface.
        triangles: (t, 3) int64, vertex ids of the surface's triangles.
        cell: spacing of the grid [m].
        start: (3,) position of the grid's first point [m].
        distances: (a, b, c) float64 [m], distances of the grid's points from the surface, negative inside.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]
    cell: float
    start: NDArray[np.float64]
    distances: NDArray[np.float64]

    @property
    def size(self) -> float:
        """Diagonal of the solid's bounding box [m]."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))


def make_solid(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], *, cell: float | None = None, where: str = "surface"
) -> Solid:
    """Return the solid inside a closed surface; the last eight solids are cached in memory.

    Args:
        vertices: (n, 3) [m].
        triangles: (t, 3) vertex ids of a closed surface with outward orientation.
        cell: spacing of the grid [m]; None for a 64th of the longest edge of the bounding box.
        where: name of the surface in an error.

    Raises:
        MeshError: the surface is inside out, the grid has too many points, or the grid is too coarse for the surface.
    """
    vertices, triangles = np.asarray(vertices, dtype=np.float64), np.asarray(triangles, dtype=np.int64)
    require_outward(vertices, triangles, where=where)
    extent = np.ptp(vertices, axis=0)
    cell = float(extent.max()) / CELLS if cell is None else cell
    count = np.ceil(extent / cell) + 2 * MARGIN + 1
    if count.prod() > MOST_POINTS:
        fitting = cell * (count.prod() / MOST_POINTS) ** (1 / 3)
        text = f"cell = {cell:g} m gives a grid of {count.prod():.3g} points; allowed: up to {MOST_POINTS:.3g}"
        raise MeshError(where, [f"{text}; remedy: a cell of at least {fitting:.2g} m"])
    solid = _measure(vertices.tobytes(), triangles.tobytes(), cell)
    share = float((solid.distances < 0.0).sum()) * cell**3 / shells(vertices, triangles).volume
    if abs(share - 1.0) > VOLUME_ERROR:
        remedy = "remedy: a smaller cell, at most half the thinnest wall; parts that overlap must be made one"
        raise MeshError(where, [f"cell = {cell:g} m: the grid has {share:.0%} of the surface's volume; {remedy}"])
    return solid


def require_outward(vertices: NDArray[np.float64], triangles: NDArray[np.int64], *, where: str) -> None:
    """Check that the normals of a surface point outward; the arguments are those of `make_solid`.

    Raises:
        MeshError: the volume is not positive; the error names the volume and the remedy.
    """
    volume = float(cone_volumes(vertices, triangles).sum())
    if not volume > 0.0:
        remedy = "remedy: turn its triangles around (MeshLab: Invert Faces Orientation, Blender: Recalculate Outside)"
        raise MeshError(where, [f"the surface is inside out: it bounds a volume of {volume:.3g} m^3; {remedy}"])


@lru_cache(maxsize=8)
def _measure(vertex_bytes: bytes, triangle_bytes: bytes, cell: float) -> Solid:
    from gdfe_ros.mesh.surfaces.triangle_kernels import (
        nearest_distances,  # scenes without such obstacles load without numba
    )

    vertices = np.frombuffer(vertex_bytes).reshape(-1, 3)
    triangles = np.frombuffer(triangle_bytes, dtype=np.int64).reshape(-1, 3)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    count = np.ceil((high - low) / cell).astype(int) + 2 * MARGIN + 1
    start = 0.5 * (low + high) - 0.5 * cell * (count - 1)
    points = start + cell * np.stack(np.unravel_index(np.arange(count.prod()), count), axis=1)
    tree, distances = BoxTree.of(vertices, triangles), np.empty(count)
    nearest_distances(points, tree.corners, tree.boxes, distances.reshape(-1))
    distances[points_inside((vertices - start) / cell, triangles, tuple(count))] *= -1.0
    distances.flags.writeable = False
    return Solid(vertices, triangles, cell, start, distances)
