# SPDX-License-Identifier: Apache-2.0
"""Compiled signed distances to shapes, and to meshes by samples on a grid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.constraints.form import Form
from gdfe_ros.mesh.triples import combine, dot

PLANE, SPHERE, BOX, CAPSULE, CYLINDER, MESH = range(6)
"""Kinds of shapes: the values of ``kind`` in `gdfe_ros.constraints.form`."""
ORIGIN = 9
"""Offset of the origin [m] in a ``frame`` (12,), after its rotation."""
START, CELL, COUNTS, SAMPLES = 0, 3, 4, 7
"""Offsets in the array of a mesh's grid: first point [m], spacing [m], three counts, and signed distances [m]."""

SURE = 0.7
"""Least ratio of the true distance to the interpolated distance. Outside the grid the interpolated distance is up to
sqrt(2) times too large.
"""


@inlined
def signed_distance(kind, a, b, c, x, y, z):
    """Return the signed distance [m] from a point to a shape, negative inside, and its gradient (3,).

    ``a``, ``b`` and ``c`` [m] are the shape's ``numbers`` (see `Form`). At a centre, or on a medial plane, the gradient
    is not unique. The function then returns one of its limits.
    """
    if kind == PLANE:
        return z, 0.0, 0.0, 1.0
    if kind == BOX:
        return box_distance(a, b, c, x, y, z)
    if kind in (SPHERE, CAPSULE):
        z -= min(max(z, -b), b)
        length = math.sqrt(x * x + y * y + z * z)
        if length == 0.0:
            return -a, 1.0, 0.0, 0.0
        return length - a, x / length, y / length, z / length
    rho = math.sqrt(x * x + y * y)
    nx, ny = (x / rho, y / rho) if rho > 0.0 else (1.0, 0.0)
    phi, nr, _, nz = box_distance(a, math.inf, b, rho, 0.0, z)
    return phi, nr * nx, nr * ny, nz


@inlined
def box_distance(a, b, c, x, y, z):
    """Return the signed distance [m] to a box with half edges ``a``, ``b``, ``c`` [m], and its gradient (3,)."""
    sx, sy, sz = math.copysign(1.0, x), math.copysign(1.0, y), math.copysign(1.0, z)
    dx, dy, dz = abs(x) - a, abs(y) - b, abs(z) - c
    if dx <= 0.0 and dy <= 0.0 and dz <= 0.0:
        if dx >= dy and dx >= dz:
            return dx, sx, 0.0, 0.0
        if dy >= dz:
            return dy, 0.0, sy, 0.0
        return dz, 0.0, 0.0, sz
    ox, oy, oz = max(dx, 0.0), max(dy, 0.0), max(dz, 0.0)
    length = math.sqrt(ox * ox + oy * oy + oz * oz)
    return length, sx * ox / length, sy * oy / length, sz * oz / length


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


@inlined
def row(frame, i):
    """Return row ``i`` (3,) of the rotation of a frame."""
    return frame[3 * i], frame[3 * i + 1], frame[3 * i + 2]


@inlined
def in_frame(frame, dx, dy, dz):
    """Return the components of a world vector along the frame's axes."""
    return combine(dx, row(frame, 0), dy, row(frame, 1), dz, row(frame, 2))


@inlined
def in_world(frame, a, b, c):
    """Return the world components of a vector that is given along the frame's axes."""
    return dot(row(frame, 0), (a, b, c)), dot(row(frame, 1), (a, b, c)), dot(row(frame, 2), (a, b, c))


@inlined
def distance_in_frame(kind, form, x, y, z):
    """Return the signed distance [m] from a point to the obstacle, and its gradient (3,), all in the frame."""
    if kind == MESH:
        return grid_distance(form, int(form[0]), x, y, z)
    return signed_distance(kind, form[0], form[1], form[2], x, y, z)


@inlined
def distance_at(kind, frame, form, px, py, pz):
    """Return the signed distance [m] from a point to the obstacle, and its gradient (3,) in world axes."""
    x, y, z = in_frame(frame, px - frame[ORIGIN], py - frame[ORIGIN + 1], pz - frame[ORIGIN + 2])
    g, a, b, c = distance_in_frame(kind, form, x, y, z)
    nx, ny, nz = in_world(frame, a, b, c)
    return g, nx, ny, nz


def form_numbers(form: Form) -> NDArray[np.float64]:
    """Return the array ``form`` of the kernels: a shape's three numbers, and the samples of a mesh."""
    return np.concatenate([form.numbers, form.samples])


@kernel
def measure(points, frame, form, kind):
    """Return signed distances (k,) [m] of ``points`` (k, 3) [m] from the obstacle, and their gradients (k, 3)."""
    away, normals = np.empty(len(points)), np.empty((len(points), 3))
    for i in range(len(points)):
        found = distance_at(kind, frame, form, points[i, 0], points[i, 1], points[i, 2])
        away[i], normals[i, 0], normals[i, 1], normals[i, 2] = found
    return away, normals
