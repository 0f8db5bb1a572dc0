# SPDX-License-Identifier: Apache-2.0
"""The pairs of self-contact: each surface vertex with its nearest face, each sharp edge with edges that cross it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.constraints.obstacle import SelfContact
from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.mesh.triples import along, corner, dot
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact_surface import BodyPoints
from gdfe_ros.solver.contact.near import KeptPairs, boxes_around, find_near, relative_motion
from gdfe_ros.solver.contact.self_contact.closest import Nearest, face_areas, least_distance, nearest_faces
from gdfe_ros.solver.contact.self_contact.crossing import LEAST, SEATS, crossing_edges, least_between
from gdfe_ros.solver.contact.self_contact.own_surface import Topology

MARGIN = 0.01
"""Candidates are searched up to this distance, divided by the body's size, beyond the search distance."""
Array, Numbers = NDArray[np.float64], NDArray[np.int64]
Candidates = tuple[Numbers, Numbers]
"""Vertices and faces (2, p) that may touch, and edges (2, e) that may cross."""
NONE = np.zeros((2, 0), np.int64)
"""No pairs."""


@kernel
def choose_pairs(found, first, own, others, start, yielding):
    """Do `OwnPairs.choose`. The four vertices of a pair are its row of ``own``, plus a row of ``others``.

    The row of ``others`` has the index of the found face or edge, plus the entry of ``start`` for the pair.
    """
    chosen, count = np.empty(len(first), np.int64), 0
    corners, give = np.empty((len(first), 4), np.int32), np.empty(len(first))
    for i in range(len(first)):
        if found.face[i] < 0 or found.support[i] < LEAST:
            continue
        whole, rest = 1.0, 0.0
        for a in range(4):
            point, weight = own[i, a] + others[found.face[i] + start[i], a], found.weights[i, a]
            corners[count, a] = point
            if point == first[i]:
                whole -= weight
            else:
                rest += weight**2 * yielding[point]
        give[count] = whole**2 * yielding[first[i]] + rest
        if give[count] > 0.0:
            chosen[count] = i
            count += 1
    return chosen[:count].copy(), corners[:count].copy(), give[:count].copy()


@kernel
def slips_of(x, first, corners, weights, normals):
    """Return the vectors (k, 3) [m] from the second members of pairs to the first, without components along normals."""
    found = np.empty((len(first), 3))
    for i in range(len(first)):
        away, n = corner(x, first[i]), corner(normals, i)
        for a in range(4):
            away = along(1.0, away, -weights[i, a], corner(x, corners[i, a]))
        found[i, 0], found[i, 1], found[i, 2] = along(1.0, away, -dot(away, n), n)
    return found


@kernel
def lay_out_pairs(first, corners, weights, carriers, shares, stencils):
    """Write the ends of the ``stencils`` of pairs: the vertices that carry each pair's five points, and their weights.

    Further ends repeat the first one, without weight.
    """
    width = carriers.shape[1]
    for i in range(len(first)):
        for a in range(5):
            point, weight = (corners[i, a - 1], -weights[i, a - 1]) if a else (first[i], 1.0)
            for c in range(width):
                e, share = a * width + c, weight * shares[point, c]
                stencils.ends[i, e], stencils.pressing[i, e], stencils.rubbing[i, e] = carriers[point, c], share, share
        for e in range(5 * width, stencils.ends.shape[1]):
            stencils.ends[i, e] = stencils.ends[i, 0]


class OwnPairs:
    """All pairs of a body that may touch: each vertex with a face, then each seat of an edge with another edge.

    The vector from the second member of a pair to the first is x_v - sum w_a x_a, with a vertex v, four vertices a and
    weights w_a of sum 1. For a vertex and a face, these are the vertex and the corners of the face. For the edges ab
    and cd, v is a, and the four vertices are a, c, b, d with the weights s, 1 - t, -s, t.

    Args:
        body: the discretised body.
        points: the points of the body.
        meant: the self-contact of the scene.

    Attributes:
        surface: the vertices, faces and edges.
        count: number of pairs k.
        first: (k,) int32 vertex v of each pair.
        kept: the last candidates, from which `look` chooses.
    """

    def __init__(self, body: Body, points: BodyPoints, meant: SelfContact) -> None:
        lined = flat_quads(meant.triangles) + np.int32(points.count)
        self.surface = surface = Topology.of(body, points, np.concatenate([meant.quads, lined]))
        own, seats = len(surface.vertices), np.repeat(surface.ends, SEATS, axis=0)
        self.first = np.concatenate([surface.vertices, seats[:, 0]])
        self.count = len(self.first)
        # The four vertices of a pair are a row for its own part plus a row for the face or edge; an edge -1 has zeros.
        self._own, others = np.zeros((self.count, 4), np.int32), np.zeros((1 + len(surface.ends), 4), np.int32)
        self._own[own:, ::2], others[1:, 1::2] = seats, surface.ends
        self._others = np.concatenate([surface.quads, others])
        self._start = np.repeat([0, len(surface.quads) + 1], [own, len(seats)])
        self.kept = KeptPairs(self._find, surface.vertices, MARGIN * body.size, (NONE, NONE))

    def look(
        self,
        x: Array,
        last: Array,
        reach: float,
        before: Numbers,
        *,
        sunk: NDArray[np.bool_] | None = None,
        candidates: Candidates | None = None,
    ) -> Nearest:
        """Return the nearest face of each vertex, and the edges in the seats of each edge.

        Args:
            x: (n + p, 3) [m] positions; if they are not finite, nothing is found.
            last: (n + p, 3) [m] positions of the last accepted state.
            reach: [m] search distance.
            before: (k,) previous faces and edges of all pairs; -1 for none.
            sunk: (k,) whether each surface vertex already penetrated at ``last``; None if none did.
            candidates: the pairs to examine; None for all pairs within ``reach``.
        """
        surface, (faces, edges) = self.surface, self.kept.within(x, reach) if candidates is None else candidates
        sunk = np.zeros(len(surface.vertices), dtype=np.bool_) if sunk is None else sunk
        found, areas = Nearest.none(self.count), face_areas(x, surface.quads)
        nearest_faces(x, last, sunk, faces, surface, areas, reach, found)
        crossing_edges(x, last, edges, surface, areas, reach, before, found)
        return found

    def clearance(self, x: Array, reach: float) -> float:
        """Return the least distance [m] of two parts of the surface that may touch at ``x``, at most ``reach`` [m]."""
        if not np.isfinite(x).all():
            return 0.0
        faces, edges = self.kept.within(x, reach)
        return float(least_between(x, edges, self.surface.ends, least_distance(x, faces, self.surface, reach)))

    def motion(self, x: Array, before: Array) -> float:
        """Return the largest displacement [m] of a point of the surface, relative to the surface's mean."""
        return relative_motion(x, before, self.surface.vertices)

    def _find(self, x: Array, within: float) -> Candidates:
        """Return the pairs that come within a distance [m] at the points ``x`` (n + p, 3) [m]."""
        surface = self.surface
        own, edges = surface.vertices[:, None], boxes_around(x, surface.ends)
        boxes, quads = boxes_around(x, own), boxes_around(x, surface.quads)
        faces = find_near(boxes, quads, own, surface.near, within)
        later, earlier = find_near(edges, edges, surface.ends, surface.beside, within)
        return faces, np.stack([earlier, later]).compress(earlier < later, axis=1)

    def nearest_to(self, x: Array, pairs: Numbers, others: Numbers) -> Nearest:
        """Return the closest points of some ``pairs`` (p,) on the given faces or edges ``others`` (p,)."""
        count, before = len(self.surface.vertices), np.full(self.count, -1)
        before[pairs], own = others, pairs < count
        edges = np.stack([(pairs - count) // SEATS, others]).compress(~own, axis=1)
        given = np.stack([pairs, others]).compress(own, axis=1), edges
        return self.look(x, x, np.inf, before, sunk=np.ones(count, dtype=np.bool_), candidates=given)

    def carriers(self, pairs: Numbers, others: Numbers) -> NDArray[np.int32]:
        """Return the four vertices (p, 4) of some ``pairs`` (p,) with the faces or edges ``others`` (p,)."""
        return self._own[pairs] + self._others[others + self._start[pairs]]

    def choose(self, found: Nearest, yielding: Array) -> tuple[Numbers, NDArray[np.int32], Array]:
        """Return the pairs (p,) that may press, the four vertices (p, 4) of each, and their compliances (p,) [m/N].

        ``yielding`` (n + p,) [m/N] are the compliances of the points.
        """
        return choose_pairs(found, self.first, self._own, self._others, self._start, yielding)
