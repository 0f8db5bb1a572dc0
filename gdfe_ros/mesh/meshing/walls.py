# SPDX-License-Identifier: Apache-2.0
"""Thickness of a body's walls, cells that are too long for thin walls, and sizes of cells that fit them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.errors import show_point
from gdfe_ros.mesh.cells.tetrahedra import facets
from gdfe_ros.mesh.files.mesher_process import estimate_cells
from gdfe_ros.mesh.overlap import TOUCH
from gdfe_ros.mesh.surfaces.shells import BoxTree, doubled_areas
from gdfe_ros.mesh.surfaces.surface_edges import refine
from gdfe_ros.mesh.tetmesh import TetMesh

MOST_RAYS = 400_000
"""Limit of the number of places at which the thickness is measured; it bounds time and memory."""
OPPOSITE = 45.0
"""Largest angle [degrees] between the two faces of a wall; faces at a larger angle, as at a sharp edge, are no wall."""


@dataclass(frozen=True, eq=False)
class Walls:
    """The thickness of a body's walls at places on its surface.

    Attributes:
        places: (k, 3) [m].
        areas: (k,) [m^2], area of the part of the surface around each place.
        thickness: (k,) [m], distance along the inward normal to the next face; inf where this face is not opposite.
        corners: (k, 3, 3) [m], the triangle around each place.
    """

    places: NDArray[np.float64]
    areas: NDArray[np.float64]
    thickness: NDArray[np.float64]
    corners: NDArray[np.float64]

    @classmethod
    def join(cls, several: Sequence[Walls]) -> Walls:
        """Return the walls of several bodies together."""
        return cls(*(np.concatenate([getattr(one, item.name) for one in several]) for item in fields(cls)))

    @property
    def thinnest(self) -> int:
        """Number of the place with the least thickness."""
        return int(np.argmin(self.thickness))

    def fraction(self, some: NDArray[np.bool_]) -> float:
        """Return the fraction of the surface that belongs to the places marked in ``some`` (k,)."""
        return float(self.areas[some].sum() / self.areas.sum())


def find_walls(vertices: NDArray[np.float64], triangles: NDArray[np.integer], *, spacing: float) -> Walls:
    """Measure the thickness of the walls of a body.

    Triangles are divided until no edge is longer than ``spacing``. The thickness is measured from the centroid of each
    part, by a ray along the inward normal to the next face. There is a wall if the angle between the two faces is at
    most `OPPOSITE`.

    Args:
        vertices: positions [m], shape (n, 3).
        triangles: vertex ids of a closed surface with normals out of the material, shape (t, 3).
        spacing: distance of neighbouring places [m]; it is enlarged if there would be more than `MOST_RAYS` places.
    """
    area = 0.5 * float(doubled_areas(vertices[triangles])[1].sum())
    points, parts = refine(vertices, triangles, max(spacing, (2.0 * area / MOST_RAYS) ** 0.5))
    return thickness_at(points[parts], vertices, triangles)[0]


def find_solid_walls(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], solid: NDArray[np.int64], *, spacing: float
) -> Walls:
    """Measure the walls of each of several solids; ``solid`` (t,) is the number of each triangle's solid."""
    numbers = range(int(solid.max()) + 1)
    return Walls.join([find_walls(vertices, triangles[solid == k], spacing=spacing) for k in numbers])


def thickness_at(
    starts: NDArray[np.float64], vertices: NDArray[np.float64], triangles: NDArray[np.integer]
) -> tuple[Walls, NDArray[np.bool_]]:
    """Measure the thickness at the centroids of triangles ``starts`` (k, 3, 3) [m] on a surface, as in `find_walls`.

    Returns:
        The walls, and whether each of ``starts`` is among them, shape (k,). Triangles without an area have no normal,
        and are left out.
    """
    from gdfe_ros.mesh.surfaces.triangle_kernels import first_hits  # loads numba

    tolerance = TOUCH * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    across, doubled = doubled_areas(starts)
    solid = doubled > tolerance**2
    starts, outward, areas = starts[solid], across[solid] / doubled[solid, None], 0.5 * doubled[solid]
    tree = BoxTree.of(vertices, triangles)
    lengths, hits = np.empty(len(starts)), np.empty(len(starts), dtype=np.int64)
    places = starts.mean(axis=1)
    first_hits(places, np.ascontiguousarray(-outward), tree.corners, tree.boxes, tolerance, lengths, hits)
    facing = np.einsum("ki,ki->k", outward, tree.normals[hits])
    wall = (hits >= 0) & (facing <= -np.cos(np.deg2rad(OPPOSITE)))
    return Walls(places, areas, np.where(wall, lengths, np.inf), starts), solid


FLATTEST = 4.0
"""A wall is too stiff in bending if the edges of its cells along the wall exceed this multiple of its thickness. A
clamped strip, 20 times as wide as thick, with one cell through its thickness was 1 % too stiff at a ratio of 2.8, 6 %
at 4.0, 15 % at 5.7, and 25 % at 7.1.
"""
LEAST_FRACTION = 0.01
"""A remark on flat cells is given if they cover at least this fraction of the surface: at sharp edges there are always
some flat cells.
"""


def show_error(ratio: float) -> str:
    """Return a text about the error of walls whose cells are ``ratio`` times as long as the wall is thick."""
    return (
        f"Edges of cells there are up to {ratio:.2g} times as long as the wall is thick. Measured on a clamped strip "
        "20 times as wide as thick: 6 % too stiff at 4 times, 15 % at 5.7, 25 % at 7. One cell through the thickness "
        "is enough"
    )


def flat_walls(mesh: TetMesh) -> list[str]:
    """Return a list with a remark on walls whose cells are too long for their thickness; empty if there are none."""
    walls, edges = wall_cells(mesh)
    flatness = edges / walls.thickness
    fraction = walls.fraction(flatness > FLATTEST)
    if fraction < LEAST_FRACTION:
        return []
    worst = int(np.argmax(flatness))
    thickness = walls.thickness[worst]
    return [
        f"{fraction:.0%} of the surface is at walls that are thin for their cells, the worst {thickness:.3g} m thick "
        f"near {show_point(walls.places[worst])} m. {show_error(float(flatness[worst]))}; remedy: a smaller `size`, or "
        f"`least_size: {thickness:.2g}` beside `size`, which makes small cells only at thin walls"
    ]


def wall_cells(mesh: TetMesh) -> tuple[Walls, NDArray[np.float64]]:
    """Return the walls at the facets of a mesh's boundary, and the longest edge (k,) [m] of the face of each facet.

    A six-node face has four facets.
    """
    faces, vertices = mesh.boundary.quads, mesh.vertices
    corners = vertices[faces[:, :3]]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    triangles = facets(faces)
    walls, kept = thickness_at(vertices[triangles], vertices, triangles)
    return walls, np.repeat(edges, 4)[kept]


PARTS = 15.0
"""Number of tetrahedra along the longest side of the bounding box; it determines their default size."""
EDGES_ALONG = 2.0
"""Largest edge of a cell along a wall, divided by the thickness of the wall."""
GROWTH = 0.3
"""Increase of the size of cells per metre of distance from a thin wall; neighbouring cells differ by about a third."""
MOST_POINTS = 200_000
"""Limit of the number of grid points."""
LEVELS = 2
"""Number of levels for each doubling of the size; sizes are rounded down to a level, so that one search serves many."""


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
    return float(np.sum(estimate_cells(volumes, target[thin])))
