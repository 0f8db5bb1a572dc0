# SPDX-License-Identifier: Apache-2.0
"""Compiled search for the edge that an edge of the surface can cross, with the closest points of both."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.solver.contact.closest import among

PARALLEL = 0.1
"""Least sine of the angle between two edges that touch. Vertices and faces carry the contact of parallel edges."""
BESIDE = -0.1
"""Least share of the normal of either face of an edge in the direction of contact. Both shares are positive if the
direction is between the two normals, where only the edge can touch.
"""


@kernel
def nearest_edges(x, last, pairs, edges, surface, areas, reach, distance, edge, weights, normal, gap):
    """Find, for each sharp edge, the nearest edge that it can cross.

    Args:
        x: (n, 3) [m] positions.
        last: (n, 3) [m] positions of the last accepted state.
        pairs: (p,) first edge of each candidate pair.
        edges: (p,) second edge of each candidate pair.
        surface: the topology of the edges (`own_edges.EdgeTopology`).
        areas: (q, 3) [m^2] area vectors of the surface's faces at ``x``.
        reach: [m] search distance.
        distance: (e,) [m], is written: distance to the nearest edge; infinite if no edge is within reach.
        edge: (e,) int64, is written: the nearest edge; -1 if there is none.
        weights: (e, 4), is written: s, 1 - t, -s, t for the closest points s and t between the ends of both edges.
        normal: (e, 3), is written: unit normal of both edges, out of the nearest edge.
        gap: (e,) [m], is written: distance between the closest points along the normal.
    """
    for pair in range(len(pairs)):
        i, j = pairs[pair], edges[pair]
        if neighbours(surface, i, j):
            continue
        a, b, c, d = surface.ends[i, 0], surface.ends[i, 1], surface.ends[j, 0], surface.ends[j, 1]
        n, length = across(x, a, b, c, d)
        if not length > 0.0:
            continue
        s, t = closest_between(x, a, b, c, d)
        if not (0.0 < s < 1.0 and 0.0 < t < 1.0):
            continue
        if dot(n, areas, surface.sides[j, 0]) + dot(n, areas, surface.sides[j, 1]) < 0.0:
            n = -n[0], -n[1], -n[2]
        back = -n[0], -n[1], -n[2]
        if not (between(n, areas, surface.sides[j]) and between(back, areas, surface.sides[i])):
            continue
        height = apart(x, a, b, c, d, s, t, n)
        away = abs(height)
        if away > reach or away > distance[i] or (away == distance[i] and j > edge[i]):
            continue
        if height < -surface.depth and not apart(last, a, b, c, d, s, t, n) > 0.0:
            continue
        distance[i], edge[i], gap[i] = away, j, height
        weights[i, 0], weights[i, 1], weights[i, 2], weights[i, 3] = s, 1.0 - t, -s, t
        normal[i, 0], normal[i, 1], normal[i, 2] = n


@inlined
def neighbours(surface, i, j):
    """Return whether an end of edge ``j`` belongs to a cell beside edge ``i``; such edges can never touch."""
    for k in range(2):
        face = surface.sides[i, k]
        for end in range(2):
            if among(surface.near_starts, surface.near, face, surface.ends[j, end]):
                return True
    return False


@inlined
def across(x, a, b, c, d):
    """Return the unit normal (3,) of the edges ab and cd, and the length of their product; 0 if they are parallel."""
    u0, u1, u2 = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    v0, v1, v2 = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    length = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if not length > PARALLEL * math.sqrt((u0 * u0 + u1 * u1 + u2 * u2) * (v0 * v0 + v1 * v1 + v2 * v2)):
        return (0.0, 0.0, 0.0), 0.0
    return (n0 / length, n1 / length, n2 / length), length


@inlined
def closest_between(x, a, b, c, d):
    """Return the positions s and t, from 0 to 1 between the ends, of the closest points of the lines ab and cd."""
    uu, uv, vv, ur, vr = 0.0, 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        u, v, r = x[b, axis] - x[a, axis], x[d, axis] - x[c, axis], x[c, axis] - x[a, axis]
        uu, uv, vv, ur, vr = uu + u * u, uv + u * v, vv + v * v, ur + u * r, vr + v * r
    det = uu * vv - uv * uv
    return (vv * ur - uv * vr) / det, (uv * ur - uu * vr) / det


@inlined
def apart(x, a, b, c, d, s, t, n):
    """Return the distance [m] along ``n`` (3,) from the point t of the edge cd to the point s of the edge ab."""
    height = 0.0
    for axis in range(3):
        height += n[axis] * ((1.0 - s) * x[a, axis] + s * x[b, axis] - (1.0 - t) * x[c, axis] - t * x[d, axis])
    return height


@inlined
def dot(n, areas, face):
    """Return the inner product of a direction and the unit normal of a face; 0 for a face without area."""
    m0, m1, m2 = areas[face, 0], areas[face, 1], areas[face, 2]
    size = math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    return (n[0] * m0 + n[1] * m1 + n[2] * m2) / size if size > 0.0 else 0.0


@inlined
def between(n, areas, sides):
    """Return whether a direction normal to an edge is between the normals of the edge's faces, up to `BESIDE`."""
    m0, m1, m2 = areas[sides[0], 0], areas[sides[0], 1], areas[sides[0], 2]
    size = math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    if not size > 0.0:
        return False
    own, other = dot(n, areas, sides[0]), dot(n, areas, sides[1])
    both = dot((m0 / size, m1 / size, m2 / size), areas, sides[1])
    rest = 1.0 - both * both
    return own - both * other >= BESIDE * rest and other - both * own >= BESIDE * rest
