# SPDX-License-Identifier: Apache-2.0
"""Sizes of cells on a grid: small cells where walls are thin, which grow with the distance from these walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.mesh.mesher_process import MOST_CELLS, expected_cells
from gdfe_ros.mesh.walls import Walls

PARTS = 15.0
"""Number of tetrahedra along the longest side of the bounding box; it determines their default size."""
EDGES_ALONG = 2.0
"""Largest edge of a cell along a wall, divided by the thickness of the wall."""
GROWTH = 0.3
"""Increase of the size for each metre of distance from a thin wall [m/m]; neighbouring cells differ by about a
third."""
MOST_POINTS = 200_000
"""Limit of the number of grid points."""
LEVELS = 2
"""Number of levels into which sizes are rounded down, for each doubling of the size."""


@dataclass(frozen=True, eq=False)
class SizeField:
    """Target sizes at the points of a grid around a body.

    Attributes:
        start: (3,) position of the first point [m].
        spacing: distance of neighbouring points [m].
        sizes: (a, b, c) [m], largest edge of a cell at each point.
        cells: expected number of tetrahedra.
    """

    start: NDArray[np.float64]
    spacing: float
    sizes: NDArray[np.float64]
    cells: float

    @property
    def too_many(self) -> list[str]:
        """A list with the text of a defect if a mesh would have too many cells; empty if not."""
        if self.cells <= MOST_CELLS:
            return []
        return [
            f"least_size gives about {self.cells:.2g} tetrahedra at thin walls; allowed: up to {MOST_CELLS:g}; "
            "remedy: a larger least_size"
        ]

    def request(self) -> dict[str, NDArray]:
        """Return the arrays of a request to a mesher."""
        return {"start": self.start, "spacing": np.array(self.spacing), "sizes": self.sizes}


def default_size(bounds: NDArray[np.float64]) -> float:
    """Return the default size of tetrahedra [m] for a body between the corners ``bounds`` (2, 3) [m], in two digits."""
    return float(f"{np.ptp(bounds, axis=0).max() / PARTS:.2g}")


def wall_sizes(walls: Walls, *, size: float, least_size: float, bounds: NDArray[np.float64]) -> SizeField:
    """Return the sizes of cells for a body with thin walls.

    At a wall of thickness t, the size is `EDGES_ALONG` t, but at least ``least_size`` and at most ``size``. With the
    distance from the wall, the size grows by `GROWTH`.

    Args:
        walls: the thickness of the body's walls.
        size: largest size [m].
        least_size: smallest size [m].
        bounds: (2, 3) lowest and highest corner of the body [m].
    """
    target = np.clip(EDGES_ALONG * walls.thickness, least_size, size)
    extent = bounds[1] - bounds[0]
    spacing = max(least_size, float((extent + least_size).prod() / MOST_POINTS) ** (1.0 / 3.0))
    counts = np.ceil(extent / spacing).astype(int) + 3
    start = bounds.mean(axis=0) - 0.5 * spacing * (counts - 1)
    points = start + spacing * np.stack(np.unravel_index(np.arange(counts.prod()), counts), axis=1)
    sizes = np.full(len(points), size)
    level = np.floor(LEVELS * np.log2(target / least_size) + 1e-9).astype(int)
    for number in np.unique(level[target < size]):
        small = least_size * 2.0 ** (number / LEVELS)
        tree = cKDTree(walls.places[(level == number) & (target < size)])
        away, _ = tree.query(points, distance_upper_bound=(size - small) / GROWTH)
        sizes = np.minimum(sizes, small + GROWTH * away)
    cells = cells_at_walls(walls, size=size, least_size=least_size)
    return SizeField(start, spacing, sizes.reshape(counts), cells)


def cells_at_walls(walls: Walls, *, size: float, least_size: float) -> float:
    """Return the expected number of tetrahedra at walls that get cells smaller than ``size``, as in `wall_sizes`."""
    target = np.clip(EDGES_ALONG * walls.thickness, least_size, size)
    thin = target < size
    volumes = 0.5 * walls.areas[thin] * np.maximum(walls.thickness, target)[thin]
    return float(np.sum(expected_cells(volumes, target[thin])))
