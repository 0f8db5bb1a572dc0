# SPDX-License-Identifier: Apache-2.0
"""The sharp convex edges of the surface for self-contact, and the search for edges that cross each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.solver.contact.closest import face_areas
from gdfe_ros.solver.contact.crossing import crossing_edges, may_cross
from gdfe_ros.solver.contact.own_surface import CREASE, DEPTH, Nearest, Topology


class EdgeTopology(NamedTuple):
    """Sharp edges of the undeformed surface.

    Attributes:
        ends: (e, 2) int32 vertices at the ends of each edge.
        sides: (e, 2) int64 the two faces of each edge.
        near_starts, near: as in `Topology`.
        depth: [m] shortest edge. Two edges that passed each other by less touch even if they never were apart: sound
            bodies are thicker.
    """

    ends: NDArray[np.int32]
    sides: NDArray[np.int64]
    near_starts: NDArray[np.int64]
    near: NDArray[np.int64]
    depth: float


class OwnEdges:
    """The edges of a body that may cross each other: where the surface is convex, and not smooth.

    Elsewhere, vertices and faces carry all contact.

    Args:
        rest: (n + p, 3) [m] undeformed positions of the points.
        surface: the faces that may touch each other.

    Attributes:
        topology: the edges.
    """

    def __init__(self, rest: NDArray[np.float64], surface: Topology) -> None:
        ends, sides = _inner_sides(surface.quads)
        areas = np.empty((len(surface.quads), 3))
        face_areas(rest, surface.quads, areas)
        normals = areas / np.linalg.norm(areas, axis=1)[:, None]
        one, other = normals[sides[:, 0]], normals[sides[:, 1]]
        beyond = rest[surface.quads[sides[:, 1]]].mean(axis=1) - rest[ends].mean(axis=1)
        sharp = (np.einsum("ij,ij->i", one, other) <= CREASE) & (np.einsum("ij,ij->i", one, beyond) < 0.0)
        self._quads = surface.quads
        given = np.ascontiguousarray(ends[sharp]), np.ascontiguousarray(sides[sharp])
        self.topology = EdgeTopology(*given, surface.near_starts, surface.near, surface.depth / DEPTH)

    def search(self, x: NDArray[np.float64], within: float) -> NDArray[np.int64]:
        """Return the pairs of edges (p, 2) that come within a distance [m] at the positions ``x`` (n, 3) [m]."""
        ends = x[self.topology.ends]
        if not len(ends):
            return np.zeros((0, 2), np.int64)
        length = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max())
        near = cKDTree(ends.mean(axis=1)).query_pairs(within + length, output_type="ndarray")
        may = np.empty(len(near), dtype=np.bool_)
        may_cross(near, self.topology, may)
        near = near[may]
        return near[np.lexsort(near.T[::-1])]

    def cross(
        self,
        x: NDArray[np.float64],
        last: NDArray[np.float64],
        pairs: NDArray[np.int64],
        reach: float,
        before: NDArray[np.int64],
    ) -> Nearest:
        """Return the edges within a distance that can cross each edge, in the edge's seats.

        In the result, ``face`` is an edge, and ``weights`` are those of `OwnPairs`.

        Args:
            x: (n, 3) [m] positions.
            last: (n, 3) [m] positions of the last accepted state.
            pairs: (p, 2) both edges of each candidate pair.
            reach: [m] search distance.
            before: (`SEATS` e,) edge that was in each seat; -1 for none.
        """
        count = len(before)
        distance, edge, gap = np.full(count, np.inf), np.full(count, -1, dtype=np.int64), np.full(count, np.inf)
        weights, normal, support = np.zeros((count, 4)), np.zeros((count, 3)), np.zeros(count)
        if len(pairs):
            areas = np.empty((len(self._quads), 3))
            face_areas(x, self._quads, areas)
            found = distance, edge, weights, normal, gap, support
            crossing_edges(x, last, pairs, self.topology, areas, reach, before, *found)
        return Nearest(edge, weights, normal, gap, support)


def _inner_sides(quads: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the sides (s, 2) that two faces (q, 4) share, and these faces (s, 2)."""
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(quads)), 4)
    whole = sides[:, 0] != sides[:, 1]  # a triangle repeats its last corner
    sides, owner = sides[whole], owner[whole]
    order = np.lexsort((owner, sides[:, 1], sides[:, 0]))
    sides, owner = sides[order], owner[order]
    ends, first, count = np.unique(sides, axis=0, return_index=True, return_counts=True)
    double = first[count == 2]
    return ends[count == 2].astype(np.int32), np.stack([owner[double], owner[double + 1]], axis=1)
