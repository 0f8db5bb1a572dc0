# SPDX-License-Identifier: Apache-2.0
"""Thickness of the walls of a body, measured by rays from its surface through the material."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.box_tree import BoxTree
from gdfe_ros.mesh.refinement import refine
from gdfe_ros.mesh.self_cuts import TOUCH

MOST_RAYS = 400_000
"""Limit of the number of places at which the thickness is measured; it bounds time and memory."""
OPPOSITE = 45.0
"""Largest angle [degrees] between the two faces of a wall. At a sharp edge the faces enclose more, and are no wall."""


@dataclass(frozen=True, eq=False)
class Walls:
    """The thickness of a body's walls at places on its surface.

    Attributes:
        places: (k, 3) [m].
        areas: (k,) [m^2], area of the surface for which each place stands.
        thickness: (k,) [m], distance along the inward normal to the next face; inf where this face is not opposite.
        corners: (k, 3, 3) [m], the triangle around each place.
    """

    places: NDArray[np.float64]
    areas: NDArray[np.float64]
    thickness: NDArray[np.float64]
    corners: NDArray[np.float64]

    @classmethod
    def joined(cls, several: Sequence[Walls]) -> Walls:
        """Return the walls of several bodies together."""
        return cls(*(np.concatenate([getattr(one, item.name) for one in several]) for item in fields(cls)))

    @property
    def thinnest(self) -> int:
        """Number of the place with the least thickness."""
        return int(np.argmin(self.thickness))

    def fraction(self, some: NDArray[np.bool_]) -> float:
        """Return the fraction of the surface for which some of the places (k,) stand."""
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
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    points, parts = refine(vertices, triangles, max(spacing, (2.0 * area / MOST_RAYS) ** 0.5))
    return thickness_at(points[parts], vertices, triangles)[0]


def thickness_at(
    starts: NDArray[np.float64], vertices: NDArray[np.float64], triangles: NDArray[np.integer]
) -> tuple[Walls, NDArray[np.bool_]]:
    """Measure the thickness at the centroids of triangles ``starts`` (k, 3, 3) [m] on the surface of `find_walls`.

    Returns:
        The walls, and whether they contain each triangle, shape (k,). Triangles without an area have no normal, and are
        left out.
    """
    from gdfe_ros.mesh.ray_hits import first_hits  # loads numba

    tolerance = TOUCH * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    across = np.cross(starts[:, 1] - starts[:, 0], starts[:, 2] - starts[:, 0])
    doubled = np.linalg.norm(across, axis=1)
    solid = doubled > tolerance**2
    starts, outward, areas = starts[solid], across[solid] / doubled[solid, None], 0.5 * doubled[solid]
    tree = BoxTree.of(vertices, triangles, flat=0.0)
    lengths, hits = np.empty(len(starts)), np.empty(len(starts), dtype=np.int64)
    places = starts.mean(axis=1)
    first_hits(places, np.ascontiguousarray(-outward), tree.corners, tree.boxes, tolerance, lengths, hits)
    facing = np.einsum("ki,ki->k", outward, tree.normals[hits])
    wall = (hits >= 0) & (facing <= -np.cos(np.deg2rad(OPPOSITE)))
    return Walls(places, areas, np.where(wall, lengths, np.inf), starts), solid
