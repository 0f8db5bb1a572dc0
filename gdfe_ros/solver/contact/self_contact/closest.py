# SPDX-License-Identifier: Apache-2.0
"""Compiled closest points on bilinear faces, and the search for the face that a vertex can touch."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.mesh.triples import along, corner, cross, dot, minus, unit
from gdfe_ros.solver.contact.near import boxes_around

MOST_STEPS = 12
"""Largest number of Gauss-Newton iterations in one closest-point search. A flat face needs two."""
EQUAL = 1e-9
"""Two distances count as equal if they differ by less than this fraction."""
OPPOSED = -0.5
"""A face and a vertex can touch only if the cosine between the normals of the face and of the vertex, or of a face
around the vertex, is below this.
"""


class Nearest(NamedTuple):
    """The face that each surface vertex can touch, or the edge that each seat of an edge can touch (`crossing`).

    Attributes:
        face: (k,) int64 nearest face, or edge; -1 if none is within reach.
        distance: (k,) [m] distance; infinite if nothing is within reach.
        weights: (k, 4) weights of the face's corners at the closest point; for edges, those of `OwnPairs`.
        normal: (k, 3) unit normal of the plane that the vertex must stay in front of.
        gap: (k,) [m] signed distance to that plane; infinite if nothing is within reach.
        support: (k,) fraction of the contact force that the face or edge carries, see `nearest_faces`.
    """

    face: NDArray[np.int64]
    distance: NDArray[np.float64]
    weights: NDArray[np.float64]
    normal: NDArray[np.float64]
    gap: NDArray[np.float64]
    support: NDArray[np.float64]

    @classmethod
    def none(cls, count: int) -> Self:
        """Return ``count`` entries without anything within reach."""
        far = np.full((2, count), np.inf)
        return cls(np.full(count, -1), far[0], np.zeros((count, 4)), np.zeros((count, 3)), far[1], np.zeros(count))


@inlined
def write_pair(found, i, away, face, w, n, height, share):
    """Write an entry of `Nearest`."""
    found.face[i], found.distance[i], found.gap[i], found.support[i] = face, away, height, share
    for a in range(4):
        found.weights[i, a] = w[a]
    for a in range(3):
        found.normal[i, a] = n[a]


@inlined
def area_vector(x, quad):
    """Return the area vector (3,) [m^2] of a face: its area-weighted mean normal, which points out of the body."""
    n = cross(minus(corner(x, quad[2]), corner(x, quad[0])), minus(corner(x, quad[3]), corner(x, quad[1])))
    return 0.5 * n[0], 0.5 * n[1], 0.5 * n[2]


@kernel
def face_areas(x, quads):
    """Return the area vectors (q, 3) [m^2] of the faces ``quads``; they point out of the body."""
    areas = np.empty((len(quads), 3))
    for f in range(len(quads)):
        areas[f, 0], areas[f, 1], areas[f, 2] = area_vector(x, quads[f])
    return areas


@inlined
def corner_normal(areas, surface, f, a):
    """Return the unit normal (3,) at corner ``a`` of a face: the mean of the ``areas`` of the faces in ``smooth``."""
    n = 0.0, 0.0, 0.0
    starts, faces = surface.smooth
    for i in range(starts[4 * f + a], starts[4 * f + a + 1]):
        n = along(1.0, n, 1.0, corner(areas, faces[i]))
    return unit(n)


@inlined
def face_at(x, quad, u, v):
    """Return the point (3,) [m] of a face at the coordinates u, v from 0 to 1, and both derivatives."""
    a, b, c, d = corner(x, quad[0]), corner(x, quad[1]), corner(x, quad[2]), corner(x, quad[3])
    place = along(1.0 - v, along(1.0 - u, a, u, b), v, along(1.0 - u, d, u, c))
    return place, along(1.0 - v, minus(b, a), v, minus(c, d)), along(1.0 - u, minus(d, a), u, minus(c, b))


@inlined
def clamp(value, beyond):
    """Return a coordinate clamped to the interval from -``beyond`` to 1 + ``beyond``."""
    return min(max(value, -beyond), 1.0 + beyond)


@internal
def closest_on(x, quad, p):
    """Return the corner weights (4,) of a face's closest point to p [m], the vector from it to p, and its length."""
    u, v = 0.5, 0.5
    for _ in range(MOST_STEPS):
        place, e, g = face_at(x, quad, u, v)
        r = minus(p, place)
        uu, uv, vv, ru, rv = dot(e, e), dot(e, g), dot(g, g), dot(e, r), dot(g, r)
        det = uu * vv - uv * uv
        if not det > 0.0:
            break
        du, dv = (vv * ru - uv * rv) / det, (uu * rv - uv * ru) / det
        if not (0.0 <= u + du <= 1.0 and 0.0 <= v + dv <= 1.0):
            # If the free minimum lies outside of the square, the constrained minimum lies on a side that it crossed.
            du1 = clamp(u + du, 0.0) - u
            dv1 = clamp(v + (rv - uv * du1) / vv, 0.0) - v
            dv2 = clamp(v + dv, 0.0) - v
            du2 = clamp(u + (ru - uv * dv2) / uu, 0.0) - u
            one = 0.5 * (uu * du1 * du1 + 2.0 * uv * du1 * dv1 + vv * dv1 * dv1) - ru * du1 - rv * dv1
            two = 0.5 * (uu * du2 * du2 + 2.0 * uv * du2 * dv2 + vv * dv2 * dv2) - ru * du2 - rv * dv2
            du, dv = (du1, dv1) if one <= two else (du2, dv2)
        u, v = clamp(u + du, 0.0), clamp(v + dv, 0.0)
        if abs(du) + abs(dv) < 1e-12:
            break
    away = minus(p, face_at(x, quad, u, v)[0])
    return ((1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v), away, math.sqrt(dot(away, away))


@inlined
def opposes(areas, surface, vertex, n):
    """Return whether a vertex, or any face around it, has a normal whose cosine with n (3,) is below `OPPOSED`.

    The normal of a vertex is the mean of the normals around it. At a sharp tip, only this mean opposes the touched
    face.
    """
    s = 0.0, 0.0, 0.0
    starts, faces = surface.about
    for i in range(starts[vertex], starts[vertex + 1]):
        m = corner(areas, faces[i])
        m = unit(m)
        if dot(m, n) < OPPOSED:
            return True
        s = along(1.0, s, 1.0, m)
    return dot(s, n) < OPPOSED * math.sqrt(dot(s, s))


@inlined
def to_box(boxes, f, p):
    """Return the distance [m] from the point p to box ``f`` of bounds (q, 2, 3) [m] along the axes."""
    a = max(boxes[f, 0, 0] - p[0], p[0] - boxes[f, 1, 0], 0.0)
    b = max(boxes[f, 0, 1] - p[1], p[1] - boxes[f, 1, 1], 0.0)
    c = max(boxes[f, 0, 2] - p[2], p[2] - boxes[f, 1, 2], 0.0)
    return math.sqrt(a * a + b * b + c * c)


@kernel
def least_distance(x, pairs, surface, most):
    """Return the least distance [m] between the vertex and the face of each pair (2, p), up to ``most`` [m].

    Normals are ignored: they may come to oppose each other during the motion.
    """
    boxes = boxes_around(x, surface.quads)
    for pair in range(pairs.shape[1]):
        p, f = corner(x, surface.vertices[pairs[0, pair]]), pairs[1, pair]
        if to_box(boxes, f, p) < most:
            most = min(most, closest_on(x, surface.quads[f], p)[2])
    return most


@inlined
def face_plane(areas, surface, f, w, d, away):
    """Return the plane that a vertex must stay in front of, at its closest point on face ``f`` with weights ``w`` (4,).

    ``d`` (3,) [m] is the vector from this point to the vertex, and ``away`` [m] its length. The result is the unit
    normal (3,), the height [m] of the vertex above the plane, and the fraction of the contact force that the face
    carries. The fraction is -1 if the vertex cannot touch the face.
    """
    m = 0.0, 0.0, 0.0
    for a in range(4):
        m = along(1.0, m, w[a], corner_normal(areas, surface, f, a))
    m = unit(m)
    if dot(m, m) == 0.0:
        return m, 0.0, -1.0
    height = dot(m, d)
    beside = math.sqrt(max(0.0, away * away - height * height))
    if beside <= surface.rim:
        return m, height, 1.0 - min(1.0, beside / surface.rim) ** 2
    if height < 0.0:
        return m, height, -1.0
    # The vertex lies beside the face, at a convex edge: the edge itself is the closest point.
    return (d[0] / away, d[1] / away, d[2] / away), away, 1.0


@kernel
def nearest_faces(x, last, sunk, pairs, surface, areas, reach, found):
    """Find, for each surface vertex, the nearest face that the vertex can touch.

    A vertex deep behind a face touches this face only if it was in front of the face at ``last``. Vertices on the far
    side of a wall are thus excluded.

    Args:
        x: (n, 3) [m] positions.
        last: (n, 3) [m] positions of the last accepted state.
        sunk: (k,) whether each vertex already penetrated at ``last``. Such a vertex touches its nearest face, even if
            it is deep behind this face.
        pairs: (2, p) vertex of each candidate pair, as an index into the surface's vertices, and its face.
        surface: a `Topology`.
        areas: (q, 3) [m^2] area vectors of the faces at ``x``.
        reach: [m] search distance.
        found: `Nearest`, is written. Its fraction ``support`` is 1 above the face and falls to 0 across the rim beside
            it. Beyond the rim of a convex edge the fraction is 1, because the vertex then touches the edge.
    """
    boxes = boxes_around(x, surface.quads)
    for pair in range(pairs.shape[1]):
        i, f = pairs[0, pair], pairs[1, pair]
        vertex = surface.vertices[i]
        p, nearest = corner(x, vertex), found.distance[i]
        if to_box(boxes, f, p) > (1.0 + 2.0 * EQUAL) * min(reach, nearest):
            continue
        quad = surface.quads[f]
        if not opposes(areas, surface, vertex, unit(corner(areas, f))):
            continue
        w, d, away = closest_on(x, quad, p)
        if away > min(reach, (1.0 + EQUAL) * nearest):
            continue
        m, height, share = face_plane(areas, surface, f, w, d, away)
        if share < 0.0 or (height < -surface.depth and not (sunk[i] or was_before(last, quad, vertex, w))):
            continue
        if away >= (1.0 - EQUAL) * nearest and not is_better(share, height, found.support[i], found.gap[i]):
            continue
        write_pair(found, i, away, f, w, m, height, share)


@inlined
def is_better(share, height, other_share, other_height):
    """Return whether a face is preferred to another face that is as near: the vertex is at an edge or corner of both.

    The preferred face carries a larger fraction of the force. If the fractions are equal, it is the face whose plane is
    farther from the vertex.
    """
    if abs(share - other_share) > EQUAL:
        return share > other_share
    return abs(height) > (1.0 + EQUAL) * abs(other_height)


@inlined
def was_before(last, quad, vertex, w):
    """Return whether a vertex was in front of a face at ``last`` (n, 3) [m], at the point with weights ``w`` (4,)."""
    away = corner(last, vertex)
    for a in range(4):
        away = along(1.0, away, -w[a], corner(last, quad[a]))
    return dot(area_vector(last, quad), away) > 0.0
