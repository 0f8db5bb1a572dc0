# SPDX-License-Identifier: Apache-2.0
"""Compiled test of which triangles of a surface cut each other."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.mesh.box_tree import LEAF
from gdfe_ros.mesh.triples import along, corner, cross, dot, minus

APART = 10.0
"""Largest distance between the two sections with the common line of two triangles' planes, divided by the tolerance."""


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
    """Return the two ends [m] of the section of a triangle with a plane from which its corners are ``d`` away."""
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
    """Return whether the sections of two triangles with their planes' common line overlap, and a place of it.

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
    """Return whether two triangles overlap in a plane or cut each other along a line, and a place of it."""
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
    """Write how many others cut each triangle of a `BoxTree`, and a place where the first one does.

    Args:
        corners: (t, 3, 3) [m] corners of the tree's triangles.
        normals: (t, 3) their unit normals; triangles with normal zero are left out.
        boxes: (n, 2, 3) [m] boxes of the tree's nodes.
        tolerance: length [m] up to which triangles touch and do not cut each other.
        counts: (t,) int64, number of other triangles that cut each triangle, output.
        places: (t, 3) [m], output.
    """
    first_leaf, stack = len(boxes) // 2, np.empty(128, np.int64)
    low, high = np.empty(3), np.empty(3)
    counts[:] = 0
    for i in range(len(corners)):
        if normals[i, 0] == 0.0 and normals[i, 1] == 0.0 and normals[i, 2] == 0.0:
            continue
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
                if normals[j, 0] == 0.0 and normals[j, 1] == 0.0 and normals[j, 2] == 0.0:
                    continue
                crossing, place = cut(corners[i], corners[j], corner(normals, i), corner(normals, j), tolerance)
                if crossing:
                    for k in (i, j):
                        if counts[k] == 0:
                            places[k, 0], places[k, 1], places[k, 2] = place
                        counts[k] += 1
