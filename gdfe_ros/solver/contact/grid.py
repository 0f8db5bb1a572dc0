# SPDX-License-Identifier: Apache-2.0
"""Compiled signed distances to a mesh, in its frame, interpolated from samples on a grid."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, internal

START, CELL, COUNTS, SAMPLES = 0, 3, 4, 7
"""Layout of a mesh's grid: offsets of its first point [m], spacing [m], three counts, and signed distances [m]."""

SURE = 0.7
"""Least ratio of the true distance to the interpolated distance. Outside the grid the interpolated distance is up to
sqrt(2) times too large.
"""


@inlined
def spline(t):
    """Return the uniform cubic B-spline weights of four samples in a row, and their slopes, at the fraction ``t``.

    ``t`` runs from the second sample (0) to the third (1). The spline reproduces planes, and smooths facets and edges
    over a cell or two. Neither distance nor gradient overshoots, so there are no false dents between which a vertex
    could jump.
    """
    s = 1.0 - t
    t2, s2 = t * t, s * s
    weights = (s2 * s / 6.0, 2.0 / 3.0 - t2 * (1.0 - 0.5 * t), 2.0 / 3.0 - s2 * (1.0 - 0.5 * s), t2 * t / 6.0)
    slopes = (-0.5 * s2, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t2)
    return weights, slopes


@inlined
def inside_grid(head, base, axis, x):
    """Return the cell that contains a coordinate [m] along an axis, and the fraction in it, clamped to the grid."""
    last = head[base + COUNTS + axis] - 2.0
    u = (x - head[base + START + axis]) / head[base + CELL]
    u = min(u, last) if u > 1.0 else 1.0  # also for NaN
    i = min(int(u), int(last) - 1)
    return i, u - i


@internal
def grid_distance(head, count, x, y, z):
    """Return the distance [m] from a point to a mesh, and the exact gradient (3,) of this interpolated distance.

    The grid is the last ``count`` numbers of ``head``. A point outside the grid cannot be in contact. The function then
    takes the closest point of the grid, and the surface point nearest to this grid point. It returns the distance from
    this surface point, and the direction away from it.
    """
    base = len(head) - count
    h, ny, nz = head[base + CELL], int(head[base + COUNTS + 1]), int(head[base + COUNTS + 2])
    i, u = inside_grid(head, base, 0, x)
    j, v = inside_grid(head, base, 1, y)
    k, w = inside_grid(head, base, 2, z)
    (a, da), (b, db), (c, dc) = spline(u), spline(v), spline(w)
    phi, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for p in range(4):
        f, fy, fz = 0.0, 0.0, 0.0
        for q in range(4):
            first = base + SAMPLES + ((i - 1 + p) * ny + j - 1 + q) * nz + k - 1
            s0, s1, s2, s3 = head[first], head[first + 1], head[first + 2], head[first + 3]
            s = c[0] * s0 + c[1] * s1 + c[2] * s2 + c[3] * s3
            f, fy = f + b[q] * s, fy + db[q] * s
            fz += b[q] * (dc[0] * s0 + dc[1] * s1 + dc[2] * s2 + dc[3] * s3)
        phi, gx, gy, gz = phi + a[p] * f, gx + da[p] * f, gy + a[p] * fy, gz + a[p] * fz
    dx = x - head[base + START] - (i + u) * h
    dy = y - head[base + START + 1] - (j + v) * h
    dz = z - head[base + START + 2] - (k + w) * h
    gx, gy, gz = gx / h, gy / h, gz / h
    beyond = h * 1e-9
    if abs(dx) <= beyond and abs(dy) <= beyond and abs(dz) <= beyond:
        return phi, gx, gy, gz
    dx, dy, dz = dx + phi * gx, dy + phi * gy, dz + phi * gz
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return length, dx / length, dy / length, dz / length
