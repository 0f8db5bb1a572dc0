# SPDX-License-Identifier: Apache-2.0
"""Compiled searches and integrals over hexahedra: the cells that carry points, and columns of filled cells."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel

FARTHEST = 4.0
"""Limit of the magnitude of reference coordinates in Newton's method."""


@inlined
def clipped(value, limit):
    """Return the value, limited to -``limit`` .. ``limit``."""
    return min(max(value, -limit), limit)


@inlined
def solved(a, b, c, gap):
    """Return the solution of the 3 x 3 system with the columns a, b, c and the right-hand side gap (Cramer's rule)."""
    n0, n1, n2 = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
    m0, m1, m2 = gap[1] * c[2] - gap[2] * c[1], gap[2] * c[0] - gap[0] * c[2], gap[0] * c[1] - gap[1] * c[0]
    k0, k1, k2 = b[1] * gap[2] - b[2] * gap[1], b[2] * gap[0] - b[0] * gap[2], b[0] * gap[1] - b[1] * gap[0]
    determinant = a[0] * n0 + a[1] * n1 + a[2] * n2
    return (
        (gap[0] * n0 + gap[1] * n1 + gap[2] * n2) / determinant,
        (a[0] * m0 + a[1] * m1 + a[2] * m2) / determinant,
        (a[0] * k0 + a[1] * k1 + a[2] * k2) / determinant,
    )


@inlined
def newton_step(place, point, modes):
    """Return the next Newton iterate of a point's reference coordinates in a cell.

    ``modes`` (8, 3) [m] are the coefficients of the cell's trilinear map, as in `find_carriers`.
    """
    x, y, z = place
    gap, a, b, c = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        one, mx, my, mz = modes[0, i], modes[1, i], modes[2, i], modes[3, i]
        yz, xz, xy, xyz = modes[4, i], modes[5, i], modes[6, i], modes[7, i]
        gap[i] = point[i] - (one + mx * x + my * y + mz * z + yz * y * z + xz * x * z + xy * x * y + xyz * x * y * z)
        a[i] = mx + xz * z + xy * y + xyz * y * z
        b[i] = my + yz * z + xy * x + xyz * x * z
        c[i] = mz + yz * y + xz * x + xyz * x * y
    dx, dy, dz = solved(a, b, c, gap)
    return (
        clipped(x + clipped(dx, 1.0), FARTHEST),
        clipped(y + clipped(dy, 1.0), FARTHEST),
        clipped(z + clipped(dz, 1.0), FARTHEST),
    )


@kernel
def find_carriers(points, near, modes, settings, best, place, beyond):
    """Write the cell that carries each point, and the reference coordinates of the point in this cell.

    The cell is the candidate that contains the point, or else the nearest candidate. A candidate is nearer if the
    largest magnitude of the point's reference coordinates in it is smaller. If candidates are equally near, as at a
    common face, the cell with the lowest index carries the point. Newton's method finds the reference coordinates,
    starting from the candidate's centre.

    Args:
        points: (k, 3) [m].
        near: (k, c) indices of the candidate cells of each point, the most likely cell first.
        modes: (m, 8, 3) [m] coefficients of the cells' trilinear maps for 1, xi, eta, zeta, eta zeta, xi zeta, xi eta,
            xi eta zeta.
        settings: three numbers: limit of Newton steps; change of a reference coordinate below which they end; magnitude
            of the reference coordinates below which a point is certainly inside.
        best: (k,) cell of each point, output.
        place: (k, 3) reference coordinates of each point in its cell, output.
        beyond: (k,) largest magnitude of each point's reference coordinates, output.
    """
    steps, within, inside = settings
    for k in range(len(points)):
        best[k], beyond[k] = near[k, 0], math.inf
        for candidate in near[k]:
            here = (0.0, 0.0, 0.0)
            for _ in range(steps):
                last = here
                here = newton_step(last, points[k], modes[candidate])
                change = max(abs(here[0] - last[0]), abs(here[1] - last[1]), abs(here[2] - last[2]))
                if not change > within:
                    break
            away = max(abs(here[0]), abs(here[1]), abs(here[2]))
            alike = abs(away - beyond[k]) <= 1.0 - inside  # equal up to rounding, as on a common face
            if (alike and candidate < best[k]) or (not alike and away < beyond[k]):
                best[k], beyond[k] = candidate, away
                place[k, 0], place[k, 1], place[k, 2] = here
            if beyond[k] < inside:
                break


@inlined
def pierced(corners, x, y):
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
                if pierced(corners[t], x, y):
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
    part, current = np.zeros(7), -1
    for k in range(0, len(heights), 2):
        low, high = heights[k], heights[k + 1]
        first = min(int(low), layers - 1)
        moments[7, first * columns + column] += 1.0
        moments[7, min(int(high), layers - 1) * columns + column] += 1.0
        for layer in range(first, math.ceil(high)):
            if layer != current:
                if current >= 0:
                    for row in range(7):
                        moments[row, current * columns + column] += part[row]
                part[:] = 0.0
                current = layer
            start, end = max(low, float(layer)) - layer, min(high, float(layer + 1)) - layer
            length, zeta = max(end - start, 0.0), start + end - 1.0
            part[0] += length
            part[1] += length * xi
            part[2] += length * eta
            part[3] += length * zeta
            part[4] += length * (xi * xi + width)
            part[5] += length * (eta * eta + width)
            part[6] += length * (zeta * zeta + length * length / 3.0)
    if current >= 0:
        for row in range(7):
            moments[row, current * columns + column] += part[row]


@kernel
def integrate_columns(vertices, triangles, places, size, moments):
    """Add the integrals over the material of each cube to ``moments``, summed over the columns.

    Args:
        vertices: (n, 3) in units of the cubes' edge; columns are parallel to the last axis.
        triangles: (t, 3) vertex ids of a closed surface.
        places: (c, 2) positions of the columns in a cube, 0 .. 1.
        size: number of cubes along each axis.
        moments: (8, cubes), first axis fastest, input and output: integrals of 1, xi, eta, zeta, xi^2, eta^2, zeta^2,
            and the number of crossings of columns with the surface.
    """
    columns, width = size[0] * size[1], 1.0 / (3.0 * len(places) ** 2)
    column, height = np.empty(4 * columns, np.int64), np.empty(4 * columns)
    corners = np.empty((len(triangles), 3, 3))
    for place in places:
        for t in range(len(triangles)):
            for a in range(3):
                vertex = vertices[triangles[t, a]]
                corners[t, a, 0], corners[t, a, 1], corners[t, a, 2] = (
                    vertex[0] - place[0],
                    vertex[1] - place[1],
                    vertex[2],
                )
        found = find_crossings(corners, size, column, height)
        if found > len(column):
            column, height = np.empty(2 * found, np.int64), np.empty(2 * found)
            found = find_crossings(corners, size, column, height)
        order = np.argsort(column[:found], kind="mergesort")
        start = 0
        while start < found:
            here = column[order[start]]
            end = start
            while end < found and column[order[end]] == here:
                end += 1
            add_column(moments, np.sort(height[order[start:end]]), place, here, size, width)
            start = end
