# SPDX-License-Identifier: Apache-2.0
"""The pairs of self-contact: each surface vertex with its nearest face, each sharp edge with the edge it crosses."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.constraints.obstacle import SelfContact
from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.closest import least_distance
from gdfe_ros.solver.contact.crossing import SEATS, least_between
from gdfe_ros.solver.contact.own_edges import OwnEdges
from gdfe_ros.solver.contact.own_points import OwnPoints
from gdfe_ros.solver.contact.own_surface import Nearest, OwnSurface

MARGIN = 0.01
"""Candidates are searched up to this distance, divided by the body's size, beyond the search distance. They are
searched again after the points have moved by half of it relative to each other.
"""


@kernel
def relative_motion(x, before, points):
    """Return the largest displacement [m] of the ``points`` (k,) from ``before`` to ``x``, less their mean."""
    m0, m1, m2 = 0.0, 0.0, 0.0
    for p in points:
        m0, m1, m2 = m0 + x[p, 0] - before[p, 0], m1 + x[p, 1] - before[p, 1], m2 + x[p, 2] - before[p, 2]
    m0, m1, m2 = m0 / len(points), m1 / len(points), m2 / len(points)
    longest = 0.0
    for p in points:
        d0, d1, d2 = x[p, 0] - before[p, 0] - m0, x[p, 1] - before[p, 1] - m1, x[p, 2] - before[p, 2] - m2
        square = d0 * d0 + d1 * d1 + d2 * d2
        longest = square if not square <= longest else longest
    return math.sqrt(longest)


class OwnPairs:
    """All pairs of a body that may touch: each vertex with a face, then each seat of an edge with another edge.

    The vector from the second member of a pair to the first is x_v - sum w_a x_a, with a vertex v, four vertices a and
    weights w_a of sum 1. For a vertex and a face, these are the vertex and the corners of the face. For the edges ab
    and cd, v is a, and the four vertices are a, c, b, d with the weights s, 1 - t, -s, t.

    Args:
        body: the discretised body.
        points: the points of the body.
        meant: the self-contact definition.

    Attributes:
        surface: the vertices and faces.
        edges: the edges.
        count: number of pairs k.
        first: (k,) int32 vertex v of each pair.
    """

    def __init__(self, body: Body, points: OwnPoints, meant: SelfContact) -> None:
        lined = flat_quads(meant.triangles) + np.int32(points.count)
        self.surface = OwnSurface(body, points, np.concatenate([meant.quads, lined]))
        self.edges = OwnEdges(points.at(body.rest), self.surface.topology)
        vertices, faces, ends = self.surface.topology.vertices, self.surface.topology.quads, self.edges.topology.ends
        self._vertices, seats = len(vertices), np.repeat(ends, SEATS, axis=0)
        self.first = np.concatenate([vertices, seats[:, 0]])
        self.count = len(self.first)
        # The four vertices of a pair are a row for its own part plus a row for the face or edge; an edge -1 has zeros.
        own, others = np.zeros((self.count, 4), np.int32), np.zeros((1 + len(ends), 4), np.int32)
        own[len(vertices) :, ::2], others[1:, 1::2] = seats, ends
        self._own, self._others = own, np.concatenate([faces, others])
        self._start = np.repeat([0, len(faces) + 1], [len(vertices), len(seats)])
        self._margin, self._within, self._searched = MARGIN * body.size, -np.inf, points.at(body.rest)

    def look(
        self,
        x: NDArray[np.float64],
        last: NDArray[np.float64],
        reach: float,
        before: NDArray[np.int64],
        sunk: NDArray[np.bool_] | None = None,
    ) -> Nearest:
        """Return the nearest face of each vertex, and the edges in the seats of each edge.

        Args:
            x: (n + p, 3) [m] positions; if they are not finite, nothing is found.
            last: (n + p, 3) [m] positions of the last accepted state.
            reach: [m] search distance.
            before: (k,) faces and edges of all pairs until now; -1 for none.
            sunk: (k,) whether each surface vertex already penetrated at ``last``; None if none did.
        """
        self._find_candidates(x, reach)
        sunk = np.zeros(self._vertices, dtype=np.bool_) if sunk is None else sunk
        return _joined(self.surface.nearest(x, last, *self._faces, reach, sunk), self.cross(x, last, reach, before))

    def cross(
        self, x: NDArray[np.float64], last: NDArray[np.float64], reach: float, before: NDArray[np.int64]
    ) -> Nearest:
        """Return the edges that cross each other, as `look` does."""
        self._find_candidates(x, reach)
        return self.edges.cross(x, last, self._edges, reach, before[self._vertices :])

    def clearance(self, x: NDArray[np.float64], reach: float) -> float:
        """Return the least distance [m] of two parts of the surface that may touch at ``x``, at most ``reach`` [m]."""
        self._find_candidates(x, reach)
        if not np.isfinite(self._within):
            return 0.0
        near = least_distance(x, *self._faces, self.surface.topology, reach)
        return float(least_between(x, self._edges, self.edges.topology.ends, near))

    def motion(self, x: NDArray[np.float64], before: NDArray[np.float64]) -> float:
        """Return the largest displacement [m] of a point of the surface, relative to the surface's mean."""
        return relative_motion(x, before, self.surface.topology.vertices)

    def _find_candidates(self, x: NDArray[np.float64], reach: float) -> None:
        """Find the candidates again if the points have moved too far, relative to each other, for those at hand."""
        if reach + 2.0 * self.motion(x, self._searched) <= self._within:
            return
        finite = bool(np.isfinite(x).all())
        self._searched, self._within = x.copy(), reach + self._margin if finite else -np.inf
        none = np.zeros(0, np.int64)
        self._faces = self.surface.search(x, self._within) if finite else (none, none)
        self._edges = self.edges.search(x, self._within) if finite else np.zeros((0, 2), np.int64)

    def nearest_to(self, x: NDArray[np.float64], pairs: NDArray[np.int64], others: NDArray[np.int64]) -> Nearest:
        """Return the closest points of some ``pairs`` (p,) and their given faces or edges ``others`` (p,)."""
        own = pairs < self._vertices
        inside = np.ones(self._vertices, dtype=np.bool_)
        faces = self.surface.nearest(x, x, pairs[own], others[own], np.inf, inside)
        seats = np.full(self.count - self._vertices, -1)
        place, edges = pairs[~own] - self._vertices, others[~own]
        seats[place] = edges
        return _joined(faces, self.edges.cross(x, x, np.column_stack([place // SEATS, edges]), np.inf, seats))

    def carriers(self, pairs: NDArray[np.int64], others: NDArray[np.int64]) -> NDArray[np.int32]:
        """Return the four vertices (p, 4) of some ``pairs`` (p,) with the faces or edges ``others`` (p,)."""
        return self._own[pairs] + self._others[others + self._start[pairs]]

    def give(
        self,
        yielding: NDArray[np.float64],
        pairs: NDArray[np.int64],
        carriers: NDArray[np.int32],
        weights: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the compliance (p,) [m/N] of some ``pairs`` (p,) with four vertices and weights (p, 4) each.

        ``yielding`` (n + p,) [m/N] are the compliances of the points.
        """
        first = self.first[pairs]
        own = carriers == first[:, None]
        whole = 1.0 - np.where(own, weights, 0.0).sum(axis=1)
        others = np.where(own, 0.0, weights)
        return whole**2 * yielding[first] + np.einsum("ka,ka->k", others**2, yielding[carriers])


def _joined(one: Nearest, other: Nearest) -> Nearest:
    """Return the entries of both."""
    return Nearest(*(np.concatenate([getattr(one, each.name), getattr(other, each.name)]) for each in fields(Nearest)))
