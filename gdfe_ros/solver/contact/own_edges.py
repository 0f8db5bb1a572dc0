# SPDX-License-Identifier: Apache-2.0
"""The sharp convex edges of the surface for self-contact, and the search for each edge' nearest crossing edge."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.solver.contact.closest import face_areas
from gdfe_ros.solver.contact.crossing import nearest_edges
from gdfe_ros.solver.contact.own_surface import CREASE, Nearest, Topology


class EdgeTopology(NamedTuple):
    """Sharp edges of the undeformed surface.

    Attributes:
        ends: (e, 2) int32 vertices at the ends of each edge.
        sides: (e, 2) int64 the two faces of each edge.
        near_starts, near, depth: as in `Topology`.
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
        rest: (n, 3) [m] undeformed positions.
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
        self.topology = EdgeTopology(*given, surface.near_starts, surface.near, surface.depth)

    @property
    def count(self) -> int:
        """Number of edges."""
        return len(self.topology.ends)

    def look(self, x: NDArray[np.float64], last: NDArray[np.float64], reach: float) -> Nearest:
        """Return the nearest edge that each edge can cross within a distance.

        If two edges are nearest to each other, only the first one has a partner.

        Args:
            x: (n, 3) [m] positions.
            last: (n, 3) [m] positions of the last accepted state.
            reach: [m] search distance.
        """
        middles = x[self.topology.ends].mean(axis=1)
        if not self.count or not np.isfinite(middles).all():
            return self.nearest(x, last, np.zeros(0, np.int64), np.zeros(0, np.int64), reach)
        length = float(np.linalg.norm(np.subtract(*np.moveaxis(x[self.topology.ends], 1, 0)), axis=1).max())
        near = cKDTree(middles).query_pairs(reach + length, output_type="ndarray")
        both = np.concatenate([near, near[:, ::-1]])
        found = self.nearest(x, last, *np.ascontiguousarray(both.T), reach)
        own = np.arange(self.count)
        twice = (found.face >= 0) & (found.face[found.face] == own) & (found.face < own)
        found.face[twice], found.gap[twice] = -1, np.inf
        return found

    def nearest(
        self,
        x: NDArray[np.float64],
        last: NDArray[np.float64],
        pairs: NDArray[np.int64],
        edges: NDArray[np.int64],
        reach: float,
    ) -> Nearest:
        """Return the nearest of the candidates ``edges`` (p,) that each of the edges ``pairs`` (p,) can cross.

        In the result, ``face`` is an edge, and ``weights`` belong to the vertices that `carriers` returns.
        """
        count = self.count
        distance, edge, gap = np.full(count, np.inf), np.full(count, -1, dtype=np.int64), np.full(count, np.inf)
        weights, normal = np.zeros((count, 4)), np.zeros((count, 3))
        if len(pairs):
            areas = np.empty((len(self._quads), 3))
            face_areas(x, self._quads, areas)
            found = distance, edge, weights, normal, gap
            nearest_edges(x, last, pairs, edges, self.topology, areas, reach, *found)
        return Nearest(edge, weights, normal, gap, np.ones(count))

    def carriers(self, pairs: NDArray[np.int64], edges: NDArray[np.int64]) -> NDArray[np.int32]:
        """Return the vertices (k, 4) a, c, b, d of the edges ab ``pairs`` (k,) and cd ``edges`` (k,).

        The vector from cd to ab is x_a minus the sum of the vertices times the weights s, 1 - t, -s, t.
        """
        ends = self.topology.ends
        return np.stack([ends[pairs], ends[edges]], axis=2).reshape(-1, 4)


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
