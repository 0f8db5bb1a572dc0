# SPDX-License-Identifier: Apache-2.0
"""Compiled search for the edges that an edge of the surface can cross, with the closest points of both edges."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.mesh.triples import along, corner, cross, dot, minus, unit
from gdfe_ros.solver.contact.self_contact.closest import write_pair

PARALLEL = 0.1
"""Least sine of the angle between two edges that touch. Vertices and faces carry the contact of parallel edges."""
BESIDE = 0.1
"""Only the edges can touch at a crossing if the result of `between` for each of them is at least this. If a result lies
between this number and its negative, the rims of two flat faces may cross.
"""
ENDS = 1e-3
"""Edges touch up to this fraction of their length beyond their ends. Nothing then passes between two edges in a row."""
WITHIN = 1e-4
"""Rims of flat faces cross if the crossing is at least this fraction of the length away from the ends of both edges. If
corners of two rims meet, rounding thus does not decide whether the rims cross.
"""
LEAST = 0.01
"""Least fraction of a contact force that edges carry."""
SEATS = 4
"""Largest number of edges that may cross an edge at the same time (its seats). A crossing of two edges occupies a seat
of only one of them.
"""


@kernel
def crossing_edges(x, last, pairs, surface, areas, reach, before, found):
    """Find the edges that cross each sharp edge; each of them occupies one of the `SEATS` seats of this edge.

    An edge that already had a seat keeps this seat. Another edge gets a free seat. If there is none, it gets the seat
    of the farthest edge, unless that is nearer.

    Args:
        x: (n, 3) [m] positions.
        last: (n, 3) [m] positions of the last accepted state.
        pairs: (2, p) both edges of each candidate pair.
        surface: a `Topology`.
        areas: (q, 3) [m^2] area vectors of the surface's faces at ``x``.
        reach: [m] search distance.
        before: (k,) int64 previous face of each surface vertex, then previous edge of each seat; -1 for none.
        found: `Nearest`, is written at the seats. The ``weights`` are s, 1 - t, -s, t, with the positions s and t of
            the closest points on both edges. The ``normal`` is perpendicular to both edges and points out of the edge
            in the seat. The ``support`` is 1 where only edges can touch, and where rims of flat faces cross.
    """
    for known in (True, False):
        for pair in range(pairs.shape[1]):
            i, j = pairs[0, pair], pairs[1, pair]
            k = seat(before, found, len(surface.vertices) + SEATS * i, j, known)
            if k < 0:
                continue
            a, b, c, d = surface.ends[i, 0], surface.ends[i, 1], surface.ends[j, 0], surface.ends[j, 1]
            n, s, t = closest_between(x, a, b, c, d)
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
            if least < -BESIDE or carried < LEAST or abs(height) > reach or not abs(height) < found.distance[k]:
                continue
            if height < -surface.shortest and not apart(last, a, b, c, d, s, t, n) > 0.0:
                continue
            write_pair(found, k, abs(height), j, (s, 1.0 - t, -s, t), n, height, carried)


@kernel
def least_between(x, pairs, ends, most):
    """Return the least distance [m] between the two edges of each pair (2, p) that cross, up to ``most`` [m].

    ``ends`` (e, 2) are the vertices of the edges. Pairs whose closest points are not inside both edges are ignored: the
    distances between vertices and faces include them.
    """
    for pair in range(pairs.shape[1]):
        i, j = pairs[0, pair], pairs[1, pair]
        a, b, c, d = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
        n, s, t = closest_between(x, a, b, c, d)
        if 0.0 < s < 1.0 and 0.0 < t < 1.0:
            most = min(most, abs(apart(x, a, b, c, d, s, t, n)))
    return most


@inlined
def seat(before, found, first, j, known):
    """Return the seat for edge ``j``, or -1 if there is none.

    If ``known`` is True, it is the seat that the edge already had. Otherwise, for an edge without a seat, it is a free
    seat or that of the farthest edge.
    """
    best = -1
    for k in range(first, first + SEATS):
        if before[k] == j:
            return k if known else -1
        if best < 0 or found.distance[k] > found.distance[best]:
            best = k
    return -1 if known else best


@inlined
def closest_between(x, a, b, c, d):
    """Return the unit normal (3,) of the edges ab and cd, and the closest points s and t of their lines.

    A position s or t is 0 at the first end of the edge and 1 at the second. Both are infinite if the edges are nearly
    parallel.
    """
    u, v = minus(corner(x, b), corner(x, a)), minus(corner(x, d), corner(x, c))
    r, n = minus(corner(x, c), corner(x, a)), cross(u, v)
    square = dot(n, n)
    if not square > PARALLEL**2 * dot(u, u) * dot(v, v):
        return (0.0, 0.0, 0.0), math.inf, math.inf
    return unit(n), dot(cross(r, v), n) / square, dot(cross(r, u), n) / square


@inlined
def to_end(x, a, b, s):
    """Return the distance [m] from the position ``s`` to the nearer end of the edge ab; negative beyond the ends."""
    u = minus(corner(x, b), corner(x, a))
    return min(s, 1.0 - s) * math.sqrt(dot(u, u))


@inlined
def apart(x, a, b, c, d, s, t, n):
    """Return the distance [m] along ``n`` (3,) from the point t of the edge cd to the point s of the edge ab."""
    one, other = along(1.0 - s, corner(x, a), s, corner(x, b)), along(1.0 - t, corner(x, c), t, corner(x, d))
    return dot(n, minus(one, other))


@inlined
def facing(n, areas, face):
    """Return the inner product of a direction and the unit normal of a face; 0 for a face without area."""
    return dot(n, unit(corner(areas, face)))


@inlined
def between(n, areas, sides):
    """Return the smaller coefficient of ``n`` (3,), normal to an edge, as a sum of the unit normals of its two faces.

    It is positive if ``n`` lies between the normals. The result is -1 if a face has no area or the faces are parallel.
    """
    m = unit(corner(areas, sides[0]))
    own, other, both = dot(n, m), facing(n, areas, sides[1]), facing(m, areas, sides[1])
    rest = dot(m, m) - both * both
    return min(own - both * other, other - both * own) / rest if rest > 1e-300 else -1.0
