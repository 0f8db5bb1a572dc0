# SPDX-License-Identifier: Apache-2.0
"""Compiled crossings of grid columns with a surface, and integrals over the material along these columns."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel


@inlined
def is_pierced(corners, x, y):
    """Return whether the column at (x, y) pierces a triangle (3, 3).

    It does if a ray from (x, y) to +x crosses the triangle's projected outline once.
    """
    hit = False
    for first in range(3):
        second = (first + 1) % 3
        ax, ay, bx, by = corners[first, 0], corners[first, 1], corners[second, 0], corners[second, 1]
        if ay > by or (ay == by and ax > bx):
            ax, ay, bx, by = bx, by, ax, ay
        slope = (bx - ax) / (by - ay) if by - ay > 0.0 else 0.0
        hit ^= ay <= y and y < by and x < ax + (y - ay) * slope
    return hit


@inlined
def height_at(corners, x, y):
    """Return the height z of a triangle (3, 3) at the column (x, y), limited to the heights of its corners."""
    ux, uy, uz = corners[1, 0] - corners[0, 0], corners[1, 1] - corners[0, 1], corners[1, 2] - corners[0, 2]
    vx, vy, vz = corners[2, 0] - corners[0, 0], corners[2, 1] - corners[0, 1], corners[2, 2] - corners[0, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    fall = (x - corners[0, 0]) * nx + (y - corners[0, 1]) * ny
    height = corners[0, 2] - (fall / nz if nz != 0.0 else 0.0)
    low = min(corners[0, 2], corners[1, 2], corners[2, 2])
    return min(max(height, low), max(corners[0, 2], corners[1, 2], corners[2, 2]))


@kernel
def crossings(corners, size):
    """Return the column y nx + x and the height of each crossing of a grid's columns with a surface, (k,) each.

    Columns are parallel to z. ``corners`` (t, 3, 3) are the corners of the triangles in units of the columns' distance.
    ``size`` is the number of columns along x and along y, and the largest height.
    """
    column, height = np.empty(4 * size[0] * size[1], np.int64), np.empty(4 * size[0] * size[1])
    found = find_crossings(corners, size, column, height)
    if found > len(column):
        column, height = np.empty(found, np.int64), np.empty(found)
        found = find_crossings(corners, size, column, height)
    return column[:found], height[:found]


@internal
def find_crossings(corners, size, column, height):
    """Write the column and the height of each crossing of a column with the surface; return the number of crossings.

    If the arrays are too short, the remaining crossings are counted but not written.
    """
    nx, ny, nz = size
    found = 0
    for t in range(len(corners)):
        a, b, c = corners[t]
        first = max(math.ceil(min(a[0], b[0], c[0])), 0)
        last = min(math.floor(max(a[0], b[0], c[0])), nx - 1)
        low = max(math.ceil(min(a[1], b[1], c[1])), 0)
        high = min(math.floor(max(a[1], b[1], c[1])), ny - 1)
        for y in range(low, high + 1):
            for x in range(first, last + 1):
                if is_pierced(corners[t], x, y):
                    if found < len(column):
                        column[found] = y * nx + x
                        height[found] = min(max(height_at(corners[t], x, y), 0.0), float(nz))
                    found += 1
    return found


@internal
def add_column(moments, heights, place, column, size, width):
    """Add one column to ``moments`` (8, cubes): the material is between each pair of successive sorted ``heights``."""
    columns, layers = size[0] * size[1], size[2]
    xi, eta = 2.0 * place[0] - 1.0, 2.0 * place[1] - 1.0
    for k in range(0, len(heights), 2):
        low, high = heights[k], heights[k + 1]
        first = min(int(low), layers - 1)
        moments[7, first * columns + column] += 1.0
        moments[7, min(int(high), layers - 1) * columns + column] += 1.0
        for layer in range(first, math.ceil(high)):
            cube = layer * columns + column
            start, end = max(low, float(layer)) - layer, min(high, float(layer + 1)) - layer
            length, zeta = max(end - start, 0.0), start + end - 1.0
            moments[0, cube] += length
            moments[1, cube] += length * xi
            moments[2, cube] += length * eta
            moments[3, cube] += length * zeta
            moments[4, cube] += length * (xi * xi + width)
            moments[5, cube] += length * (eta * eta + width)
            moments[6, cube] += length * (zeta * zeta + length * length / 3.0)


@kernel
def integrate_columns(vertices, triangles, places, size, moments):
    """Integrate over the material of each cube along all columns, and add the results to ``moments``.

    Args:
        vertices: (n, 3) in units of the cubes' edge; columns are parallel to the last axis.
        triangles: (t, 3) vertex ids of a closed surface.
        places: (c, 2) positions of the columns in a cube, 0 .. 1.
        size: number of cubes along each axis.
        moments: (8, cubes), first axis fastest, input and output: integrals of 1, xi, eta, zeta, xi^2, eta^2, zeta^2,
            and the number of crossings of columns with the surface.
    """
    width = 1.0 / (3.0 * len(places) ** 2)
    corners = np.empty((len(triangles), 3, 3))
    for place in places:
        for t in range(len(triangles)):
            for a in range(3):
                x, y, z = vertices[triangles[t, a]]
                corners[t, a, 0], corners[t, a, 1], corners[t, a, 2] = x - place[0], y - place[1], z
        column, height = crossings(corners, size)
        order = np.argsort(column, kind="mergesort")
        start = 0
        while start < len(column):
            here = column[order[start]]
            end = start
            while end < len(column) and column[order[end]] == here:
                end += 1
            add_column(moments, np.sort(height[order[start:end]]), place, here, size, width)
            start = end
