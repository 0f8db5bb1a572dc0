# SPDX-License-Identifier: Apache-2.0
"""Compiled searches among triangles: distances, first hits of rays, and triangles that cut each other."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.mesh.surfaces.shells import LEAF
from gdfe_ros.mesh.triples import along, corner, cross, dot, minus


@inlined
def squared_distance(p, corners):
    """Return the squared distance [m^2] from a point to a triangle (3, 3) [m] with nonzero area."""
    a = corners[0, 0], corners[0, 1], corners[0, 2]
    ab = minus((corners[1, 0], corners[1, 1], corners[1, 2]), a)
    ac = minus((corners[2, 0], corners[2, 1], corners[2, 2]), a)
    ap = minus(p, a)
    g00, g01, g11, r0, r1 = dot(ab, ab), dot(ab, ac), dot(ac, ac), dot(ab, ap), dot(ac, ap)
    area = g00 * g11 - g01 * g01
    s, t = (g11 * r0 - g01 * r1) / area, (g00 * r1 - g01 * r0) / area
    if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
        rest = minus(ap, along(s, ab, t, ac))
        return dot(rest, rest)
    s = min(max(r0 / g00, 0.0), 1.0)
    rest = minus(ap, along(s, ab, 0.0, ac))
    least = dot(rest, rest)
    t = min(max(r1 / g11, 0.0), 1.0)
    rest = minus(ap, along(0.0, ab, t, ac))
    least = min(least, dot(rest, rest))
    bc, bp = minus(ac, ab), minus(ap, ab)
    u = min(max(dot(bc, bp) / dot(bc, bc), 0.0), 1.0)
    rest = minus(bp, along(u, bc, 0.0, bc))
    return min(least, dot(rest, rest))


@inlined
def squared_box_distance(point, box):
    """Return the squared distance [m^2] from a point to a box, zero inside."""
    x = max(box[0, 0] - point[0], point[0] - box[1, 0], 0.0)
    y = max(box[0, 1] - point[1], point[1] - box[1, 1], 0.0)
    z = max(box[0, 2] - point[2], point[2] - box[1, 2], 0.0)
    return x * x + y * y + z * z


@kernel
def nearest_distances(points, corners, boxes, out):
    """Write the distance [m] of each point from the nearest triangle of a `BoxTree`.

    Each search begins with the triangle nearest to the previous point. It is fast if successive points are close
    together, such as those of a grid.

    Args:
        points: (k, 3) [m].
        corners: (t, 3, 3) [m] corners of the tree's triangles.
        boxes: (n, 2, 3) [m] boxes of the tree's nodes.
        out: (k,) [m], output.
    """
    first_leaf, stack, nearest = len(boxes) // 2, np.empty(128, np.int64), 0
    for k in range(len(points)):
        point = corner(points, k)
        least = squared_distance(point, corners[nearest])
        stack[0], depth = 0, 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if squared_box_distance(point, boxes[node]) >= least:
                continue
            if node < first_leaf:
                stack[depth], stack[depth + 1] = 2 * node + 1, 2 * node + 2
                depth += 2
                continue
            start = (node - first_leaf) * LEAF
            for j in range(start, min(start + LEAF, len(corners))):
                away = squared_distance(point, corners[j])
                if away < least:
                    least, nearest = away, j
        out[k] = math.sqrt(least)


EDGE = 1e-9
"""Barycentric margin by which triangles are enlarged for rays, so that no ray slips between two triangles."""


@internal
def ray_length(start, direction, corners):
    """Return the distance along a ray at which it pierces a triangle; inf if it does not (Moeller and Trumbore)."""
    a = corner(corners, 0)
    e, f = minus(corner(corners, 1), a), minus(corner(corners, 2), a)
    p = cross(direction, f)
    volume = dot(e, p)
    if volume == 0.0:
        return math.inf
    s = minus(start, a)
    u, q = dot(s, p) / volume, cross(s, e)
    v = dot(direction, q) / volume
    return dot(f, q) / volume if u >= -EDGE and v >= -EDGE and u + v <= 1.0 + EDGE else math.inf


@internal
def box_length(start, direction, box):
    """Return the distance along a ray at which it enters a box, 0 from inside; inf if it misses the box."""
    near, far = 0.0, math.inf
    for x in range(3):
        if direction[x] == 0.0:
            if start[x] < box[0, x] or start[x] > box[1, x]:
                return math.inf
        else:
            a, b = (box[0, x] - start[x]) / direction[x], (box[1, x] - start[x]) / direction[x]
            near, far = max(near, min(a, b)), min(far, max(a, b))
    return near if near <= far * (1.0 + 1e-12) else math.inf


@kernel
def first_hits(starts, directions, corners, boxes, least, lengths, hits):
    """Write the distance along each ray to the first triangle of a `BoxTree`, and the index of this triangle.

    Args:
        starts: (r, 3) [m] starts of the rays.
        directions: (r, 3) unit vectors of the rays.
        corners: (t, 3, 3) [m] corners of the tree's triangles.
        boxes: (n, 2, 3) [m] boxes of the tree's nodes.
        least: triangles up to this distance [m] are ignored, such as the one on which a ray starts.
        lengths: (r,) [m], inf if the ray hits no triangle, output.
        hits: (r,) int64 index of the triangle in the tree, -1 if the ray hits none, output.
    """
    first_leaf, stack = len(boxes) // 2, np.empty(128, np.int64)
    for r in range(len(starts)):
        best, hit = math.inf, -1
        place, direction = corner(starts, r), corner(directions, r)
        stack[0], depth = 0, 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if box_length(place, direction, boxes[node]) >= best:
                continue
            if node < first_leaf:
                left, right = 2 * node + 1, 2 * node + 2
                if box_length(place, direction, boxes[left]) < box_length(place, direction, boxes[right]):
                    left, right = right, left
                stack[depth], stack[depth + 1] = left, right
                depth += 2
                continue
            start = (node - first_leaf) * LEAF
            for j in range(start, min(start + LEAF, len(corners))):
                length = ray_length(place, direction, corners[j])
                if least < length < best:
                    best, hit = length, j
        lengths[r], hits[r] = best, hit


APART = 10.0
"""Two triangles cut each other only if their sections are at most this many tolerances apart. Up to rounding, both
sections lie on the common line of the planes.
"""


@inlined
def height(normal, origin, point, tolerance):
    """Return the distance [m] of a point from a plane; zero up to the tolerance."""
    d = dot(normal, minus(point, origin))
    return d if abs(d) > tolerance else 0.0


@inlined
def heights(normal, origin, corners, tolerance):
    """Return the distances (3,) [m] of a triangle's corners from a plane, as in `height`."""
    return (
        height(normal, origin, corner(corners, 0), tolerance),
        height(normal, origin, corner(corners, 1), tolerance),
        height(normal, origin, corner(corners, 2), tolerance),
    )


@internal
def section(corners, d):
    """Return the two ends [m] of the section of a triangle with a plane; ``d`` are its corners' distances from it."""
    first = second = corner(corners, 0)
    n = 0
    for k in range(3):
        m = (k + 1) % 3
        if d[k] == 0.0 or d[k] * d[m] < 0.0:
            s = 0.0 if d[k] == 0.0 else d[k] / (d[k] - d[m])
            end = along(1.0 - s, corner(corners, k), s, corner(corners, m))
            if n == 0:
                first = end
            else:
                second = end
            n += 1
    return first, second


@internal
def separates(normal, own, other, tolerance):
    """Return whether an edge of a triangle separates it from another triangle in the same plane."""
    for k in range(3):
        a, b, c = corner(own, k), corner(own, (k + 1) % 3), corner(own, (k + 2) % 3)
        out = cross(minus(b, a), normal)
        length = math.sqrt(dot(out, out))
        if dot(out, minus(c, a)) > 0.0:
            length = -length
        least = math.inf
        for m in range(3):
            least = min(least, dot(out, minus(corner(other, m), a)) / length)
        if least >= -tolerance:
            return True
    return False


@internal
def cut_along_a_line(a, b, da, db, line, tolerance):
    """Return whether the sections of two triangles with their planes' common line overlap, and a point of the overlap.

    ``da`` and ``db`` are the distances [m] of the corners of each triangle from the plane of the other one.
    """
    (p0, p1), (q0, q1) = section(a, da), section(b, db)
    a0, a1, b0, b1 = dot(line, p0), dot(line, p1), dot(line, q0), dot(line, q1)
    low, high = max(min(a0, a1), min(b0, b1)), min(max(a0, a1), max(b0, b1))
    if high - low <= tolerance:
        return False, p0
    s, t = (0.5 * (low + high) - a0) / (a1 - a0), (0.5 * (low + high) - b0) / (b1 - b0)
    place = along(1.0 - s, p0, s, p1)
    away = minus(place, along(1.0 - t, q0, t, q1))
    return dot(away, away) <= (APART * tolerance) ** 2, place


@internal
def cut(a, b, na, nb, tolerance):
    """Return whether two triangles overlap in a plane or cut each other along a line, and a point where they do."""
    origin = corner(a, 0)
    db = heights(na, origin, b, tolerance)
    if min(db) > 0.0 or max(db) < 0.0:
        return False, origin
    origin = corner(b, 0)
    da = heights(nb, origin, a, tolerance)
    if min(da) > 0.0 or max(da) < 0.0:
        return False, origin
    if min(da) == max(da) or min(db) == max(db):
        middle = along(0.5, along(1.0, corner(a, 0), 1.0, corner(a, 1)), 0.5, corner(b, 0))
        middle = along(1.0, middle, 0.5, along(1.0, corner(a, 2), 1.0, along(1.0, corner(b, 1), 1.0, corner(b, 2))))
        apart = separates(na, a, b, tolerance) or separates(na, b, a, tolerance)
        return not apart, along(1.0 / 3.0, middle, 0.0, middle)
    through_a, through_b = min(da) < 0.0 < max(da), min(db) < 0.0 < max(db)
    on_a = (da[0] == 0.0) + (da[1] == 0.0) + (da[2] == 0.0) == 2
    on_b = (db[0] == 0.0) + (db[1] == 0.0) + (db[2] == 0.0) == 2
    line = cross(na, nb)
    length = math.sqrt(dot(line, line))
    if length == 0.0 or not ((through_a and (through_b or on_b)) or (through_b and on_a)):
        return False, origin
    return cut_along_a_line(a, b, da, db, along(1.0 / length, line, 0.0, line), tolerance)


@kernel
def count_cuts(corners, normals, boxes, tolerance, counts, places):
    """Count the triangles that cut each triangle of a `BoxTree`, and write a point where the first one does.

    Args:
        corners: (t, 3, 3) [m] corners of the tree's triangles.
        normals: (t, 3) their unit normals.
        boxes: (n, 2, 3) [m] boxes of the tree's nodes.
        tolerance: overlaps up to this length [m] count as touching, not as cutting.
        counts: (t,) int64, number of other triangles that cut each triangle, output.
        places: (t, 3) [m], output.
    """
    first_leaf, stack = len(boxes) // 2, np.empty(128, np.int64)
    low, high = np.empty(3), np.empty(3)
    counts[:] = 0
    for i in range(len(corners)):
        for x in range(3):
            low[x] = min(corners[i, 0, x], corners[i, 1, x], corners[i, 2, x])
            high[x] = max(corners[i, 0, x], corners[i, 1, x], corners[i, 2, x])
        stack[0], depth = 0, 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            apart = False
            for x in range(3):
                apart = apart or boxes[node, 0, x] > high[x] or boxes[node, 1, x] < low[x]
            if apart:
                continue
            if node < first_leaf:
                stack[depth], stack[depth + 1] = 2 * node + 1, 2 * node + 2
                depth += 2
                continue
            start = (node - first_leaf) * LEAF
            for j in range(max(start, i + 1), min(start + LEAF, len(corners))):
                crossing, place = cut(corners[i], corners[j], corner(normals, i), corner(normals, j), tolerance)
                if crossing:
                    for k in (i, j):
                        if counts[k] == 0:
                            places[k, 0], places[k, 1], places[k, 2] = place
                        counts[k] += 1
