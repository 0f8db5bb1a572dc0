# SPDX-License-Identifier: Apache-2.0
"""Compiled search for the edges that an edge of the surface can cross, with the closest points of both."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.mesh.triples import corner, cross, dot, minus
from gdfe_ros.solver.contact.closest import among

PARALLEL = 0.1
"""Least sine of the angle between two edges that touch. Vertices and faces carry the contact of parallel edges."""
BESIDE = 0.1
"""Least component of the normal of either face of an edge in the direction of contact, where only edges can touch. A
direction with components between this number and its negative may be that of flat faces whose rims cross.
"""
ENDS = 1e-3
"""Fraction of an edge' length. Edges touch up to this far beyond their ends: nothing passes between edges in a row."""
WITHIN = 1e-4
"""Fraction of an edge' length. Rims of flat faces cross if the place is at least this far within both edges. Rounding
thus does not decide whether rims cross whose corners meet.
"""
LEAST = 0.01
"""Least fraction of a contact force that edges carry."""
SEATS = 4
"""Largest number of edges that may cross an edge at the same time. Of two edges, only the first counts the other."""


@kernel
def crossing_edges(x, last, pairs, surface, areas, reach, before, distance, edge, weights, normal, gap, support):
    """Find, for each seat of a sharp edge, an edge that crosses it; an edge has `SEATS` seats.

    An edge that had a seat keeps it. Others get free seats, and if there are none, that of the farthest edge.

    Args:
        x: (n, 3) [m] positions.
        last: (n, 3) [m] positions of the last accepted state.
        pairs: (p, 2) both edges of each candidate pair.
        surface: the topology of the edges (`own_edges.EdgeTopology`).
        areas: (q, 3) [m^2] area vectors of the surface's faces at ``x``.
        reach: [m] search distance.
        before: (k,) int64 edge that was in each seat; -1 for none.
        distance: (k,) [m], is written: distance to the edge in each seat; infinite for a free seat.
        edge: (k,) int64, is written: the edge in each seat; -1 for a free seat.
        weights: (k, 4), is written: s, 1 - t, -s, t for the closest points s and t between the ends of both edges.
        normal: (k, 3), is written: unit normal of both edges, out of the edge in the seat.
        gap: (k,) [m], is written: distance between the closest points along the normal.
        support: (k,), is written: fraction of the contact force that the edges carry. It is 1 where only edges can
            touch, and where rims of flat faces cross.
    """
    for known in (True, False):
        for pair in range(len(pairs)):
            i, j = pairs[pair, 0], pairs[pair, 1]
            k = seat(before, edge, distance, i, j, known)
            if k < 0:
                continue
            a, b, c, d = surface.ends[i, 0], surface.ends[i, 1], surface.ends[j, 0], surface.ends[j, 1]
            n, length = across(x, a, b, c, d)
            if not length > 0.0:
                continue
            s, t = closest_between(x, a, b, c, d)
            if not (-ENDS < s < 1.0 + ENDS and -ENDS < t < 1.0 + ENDS):
                continue
            if facing(n, areas, surface.sides[j, 0]) + facing(n, areas, surface.sides[j, 1]) < 0.0:
                n = -n[0], -n[1], -n[2]
            back = -n[0], -n[1], -n[2]
            least = min(between(n, areas, surface.sides[j]), between(back, areas, surface.sides[i]))
            height = apart(x, a, b, c, d, s, t, n)
            inside = min(to_end(x, a, b, s), to_end(x, c, d, t))
            rims = height >= -inside and min(s, 1.0 - s, t, 1.0 - t) > WITHIN
            carried = 1.0 if rims else min(1.0, max(0.0, least / BESIDE))
            if least < -BESIDE or carried < LEAST or abs(height) > reach:
                continue
            if height < -surface.depth and not apart(last, a, b, c, d, s, t, n) > 0.0:
                continue
            if not abs(height) < distance[k]:
                continue
            distance[k], edge[k], gap[k], support[k] = abs(height), j, height, carried
            weights[k, 0], weights[k, 1], weights[k, 2], weights[k, 3] = s, 1.0 - t, -s, t
            normal[k, 0], normal[k, 1], normal[k, 2] = n


@kernel
def may_cross(pairs, surface, out):
    """Write to ``out`` (p,) whether the edges of each pair (p, 2) may cross, since they belong to no cell in common."""
    for pair in range(len(pairs)):
        out[pair] = not neighbours(surface, pairs[pair, 0], pairs[pair, 1])


@kernel
def least_between(x, pairs, ends, most):
    """Return the least distance [m] between the two edges of each pair (p, 2), up to ``most`` [m].

    ``ends`` (e, 2) are the vertices of the edges.
    """
    for pair in range(len(pairs)):
        i, j = pairs[pair, 0], pairs[pair, 1]
        a, b, c, d = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
        most = min(most, to_edge(x, a, c, d), to_edge(x, b, c, d), to_edge(x, c, a, b), to_edge(x, d, a, b))
        n, length = across(x, a, b, c, d)
        if length > 0.0:
            s, t = closest_between(x, a, b, c, d)
            if 0.0 < s < 1.0 and 0.0 < t < 1.0:
                most = min(most, abs(apart(x, a, b, c, d, s, t, n)))
    return most


@inlined
def to_edge(x, v, a, b):
    """Return the distance [m] from the vertex v to the edge ab."""
    along, away = minus(corner(x, b), corner(x, a)), minus(corner(x, v), corner(x, a))
    t = min(max(dot(away, along) / max(dot(along, along), 1e-300), 0.0), 1.0)
    r = minus(away, (t * along[0], t * along[1], t * along[2]))
    return math.sqrt(dot(r, r))


@inlined
def seat(before, edge, distance, i, j, known):
    """Return the seat of edge ``i`` for edge ``j``: its own seat if ``known``, else the best other one; or -1."""
    first, found = SEATS * i, -1
    for k in range(first, first + SEATS):
        if before[k] == j:
            return k if known else -1
        if found < 0 or distance[k] > distance[found]:
            found = k
    return -1 if known else found


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
    u, v = minus(corner(x, b), corner(x, a)), minus(corner(x, d), corner(x, c))
    n = cross(u, v)
    length = math.sqrt(dot(n, n))
    if not length > PARALLEL * math.sqrt(dot(u, u) * dot(v, v)):
        return (0.0, 0.0, 0.0), 0.0
    return (n[0] / length, n[1] / length, n[2] / length), length


@inlined
def closest_between(x, a, b, c, d):
    """Return the positions s and t, from 0 to 1 between the ends, of the closest points of the lines ab and cd."""
    u, v = minus(corner(x, b), corner(x, a)), minus(corner(x, d), corner(x, c))
    r = minus(corner(x, c), corner(x, a))
    uu, uv, vv, ur, vr = dot(u, u), dot(u, v), dot(v, v), dot(u, r), dot(v, r)
    det = uu * vv - uv * uv
    return (vv * ur - uv * vr) / det, (uv * ur - uu * vr) / det


@inlined
def to_end(x, a, b, s):
    """Return the distance [m] from the position ``s`` to the nearer end of the edge ab; negative beyond the ends."""
    u = minus(corner(x, b), corner(x, a))
    return min(s, 1.0 - s) * math.sqrt(dot(u, u))


@inlined
def apart(x, a, b, c, d, s, t, n):
    """Return the distance [m] along ``n`` (3,) from the point t of the edge cd to the point s of the edge ab."""
    height = 0.0
    for axis in range(3):
        height += n[axis] * ((1.0 - s) * x[a, axis] + s * x[b, axis] - (1.0 - t) * x[c, axis] - t * x[d, axis])
    return height


@inlined
def facing(n, areas, face):
    """Return the inner product of a direction and the unit normal of a face; 0 for a face without area."""
    m = corner(areas, face)
    size = math.sqrt(dot(m, m))
    return dot(n, m) / size if size > 0.0 else 0.0


@inlined
def between(n, areas, sides):
    """Return the smaller component of the unit normals of an edge's two faces in a direction ``n`` normal to the edge.

    It is positive between both normals, and -1 for a face without area.
    """
    m = corner(areas, sides[0])
    size = math.sqrt(dot(m, m))
    if not size > 0.0:
        return -1.0
    own, other = facing(n, areas, sides[0]), facing(n, areas, sides[1])
    both = facing((m[0] / size, m[1] / size, m[2] / size), areas, sides[1])
    rest = 1.0 - both * both
    return min(own - both * other, other - both * own) / rest if rest > 0.0 else -1.0
