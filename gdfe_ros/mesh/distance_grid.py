# SPDX-License-Identifier: Apache-2.0
"""Compiled distances from the points of a grid to a surface of triangles."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.mesh.triples import along, corner, dot, minus


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


@kernel
def least_distances(points, corners, out):
    """Write the distance [m] of each of ``points`` (k, 3) from the nearest of triangles (t, 3, 3) to ``out`` (k,)."""
    for k in range(len(points)):
        point, least = corner(points, k), math.inf
        for t in range(len(corners)):
            least = min(least, squared_distance(point, corners[t]))
        out[k] = math.sqrt(least)


@internal
def nearest_ones(middle, reach, corners, among, away, out):
    """Write the triangles that may be the nearest to some point of a ball to ``out``; return their number.

    The ball has the centre ``middle`` and the radius ``reach`` [m]. The candidates are the triangles ``among``. The
    array ``away`` is scratch memory.
    """
    least = math.inf
    for m in range(len(among)):
        away[m] = squared_distance(middle, corners[among[m]])
        least = min(least, away[m])
    most, found = ((math.sqrt(least) + 2.0 * reach) * (1.0 + 1e-12)) ** 2, 0
    for m in range(len(among)):
        if away[m] <= most:
            out[found] = among[m]
            found += 1
    return found


@kernel
def grid_distances(start, cell, corners, out):
    """Write the distance [m] from each point of a grid to the nearest triangle.

    The grid is divided recursively into blocks, halved along each axis, down to single points. Each block considers
    only those triangles of its parent block that may be the nearest to one of its points.

    Args:
        start: (3,) position of the first point [m].
        cell: spacing of the points [m].
        corners: (t, 3, 3) [m] corners of the triangles, whose areas are nonzero.
        out: (a, b, c) distances [m] at the points, output.
    """
    levels = 1
    while 2**levels < max(out.shape):
        levels += 1
    among, away = np.empty((levels, len(corners)), np.int64), np.empty(len(corners))
    first, count, child = np.zeros((levels, 3), np.int64), np.zeros(levels, np.int64), np.zeros(levels, np.int64)
    among[0], count[0], level = np.arange(len(corners)), len(corners), 0
    while level >= 0:
        e = child[level]
        if e == 8:
            level -= 1
            continue
        child[level] += 1
        edge = 2 ** (levels - level - 1)
        i, j, k = (
            first[level, 0] + edge * (e & 1),
            first[level, 1] + edge * (e >> 1 & 1),
            first[level, 2] + edge * (e >> 2),
        )
        if i >= out.shape[0] or j >= out.shape[1] or k >= out.shape[2]:
            continue
        side = 0.5 * (edge - 1) * cell
        middle = start[0] + i * cell + side, start[1] + j * cell + side, start[2] + k * cell + side
        near = among[level, : count[level]]
        if edge == 1:
            least = math.inf
            for m in range(len(near)):
                least = min(least, squared_distance(middle, corners[near[m]]))
            out[i, j, k] = math.sqrt(least)
        else:
            level += 1
            count[level] = nearest_ones(middle, math.sqrt(3.0) * side, corners, near, away, among[level])
            first[level, 0], first[level, 1], first[level, 2], child[level] = i, j, k, 0
