# SPDX-License-Identifier: Apache-2.0
"""Compiled distances from a term's points to its obstacle, and the layout of the term's arrays."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.solver.contact.distance import MESH, signed_distance
from gdfe_ros.solver.contact.grid import SURE, grid_distance

AXES, ORIGIN, NUMBERS, FRICTION, SIGNS, HEAD = 0, 9, 12, 15, 16, 28
"""Layout of a term's reals. Each number is the offset of one field: the frame's rotation, the frame's origin [m], the
shape's numbers, the friction coefficient, a rigid body's signs s_a (4, 3) [1/m], and the rows of the points.
"""
SCALE, PRESS, SHEAR, ANCHOR, NORMAL, OFFSET, WEIGHTS, PLANE, FIXED, STRIDE = 0, 1, 2, 5, 8, 11, 12, 20, 24, 25
"""Layout of a point's row. The offsets are those of the stiffness [N/m] of the body there, normal force [N],
friction force t (3,) [N], anchor (3,) [m] in the frame, normal (3,), offset [m], weights (8,) and entry plane
(4,). The plane n . q = d in the frame is stored as (n, d); n = 0 means no entry plane. `FIXED` is 1 if the plane always
replaces the obstacle. `STRIDE` is the row's length.
"""
KIND, COUNT, CARRIERS, BODY, RUB, VERTICES = 0, 1, 2, 3, 7, 8
"""Layout of a term's integers. Each number is the offset of one field: the shape's kind, the number of points, the
number of vertices that carry each point, the frame's four vertices, the place of the friction weights in a point's row,
and the points' carriers. The frame's vertices are -1 for a prescribed frame. The friction weights are the point's own
weights, except for round bodies.
"""
MOST_STEPS = 60
"""Largest number of sphere-tracing moves along one path. If they do not reach the obstacle, the path only grazes it."""
SMOOTH = 0.95
"""The obstacle is smooth at a face if the mean of its unit normals at the four corners has at least this length."""


@inlined
def take_frame(x, reals, integers):
    """Write rotation and origin [m] of a rigid body's frame from its four vertices; skip a prescribed frame."""
    if integers[BODY] < 0:
        return
    for i in range(3):
        reals[ORIGIN + i] = 0.0
        for j in range(3):
            reals[AXES + 3 * i + j] = 0.0
        for a in range(4):
            p = x[integers[BODY + a], i]
            reals[ORIGIN + i] += 0.25 * p
            for j in range(3):
                reals[AXES + 3 * i + j] += p * reals[SIGNS + 3 * a + j]


@inlined
def point_at(x, reals, integers, i, weights):
    """Return the position (3,) [m] of contact point ``i``, from the ``weights`` that begin there in the point's row."""
    count = integers[CARRIERS]
    first = VERTICES + count * i
    if count == 1:
        v = integers[first]
        return x[v, 0], x[v, 1], x[v, 2]
    px, py, pz, start = 0.0, 0.0, 0.0, HEAD + STRIDE * i + weights
    for a in range(count):
        w, v = reals[start + a], integers[first + a]
        px, py, pz = px + w * x[v, 0], py + w * x[v, 1], pz + w * x[v, 2]
    return px, py, pz


@inlined
def in_frame(head, dx, dy, dz):
    """Return the components of a world vector along the frame's axes."""
    return (
        head[0] * dx + head[3] * dy + head[6] * dz,
        head[1] * dx + head[4] * dy + head[7] * dz,
        head[2] * dx + head[5] * dy + head[8] * dz,
    )


@inlined
def in_world(head, a, b, c):
    """Return the world components of a vector that is given along the frame's axes."""
    return (
        head[0] * a + head[1] * b + head[2] * c,
        head[3] * a + head[4] * b + head[5] * c,
        head[6] * a + head[7] * b + head[8] * c,
    )


@inlined
def distance_in_frame(kind, head, x, y, z):
    """Return the signed distance [m] from a point to the obstacle, and its gradient (3,), all in the frame."""
    if kind == MESH:
        return grid_distance(head, int(head[NUMBERS]), x, y, z)
    return signed_distance(kind, head[NUMBERS], head[NUMBERS + 1], head[NUMBERS + 2], x, y, z)


@inlined
def distance_at(kind, head, px, py, pz):
    """Return the signed distance [m] from a point to the obstacle, and its gradient (3,) in world axes."""
    x, y, z = in_frame(head, px - head[ORIGIN], py - head[ORIGIN + 1], pz - head[ORIGIN + 2])
    g, a, b, c = distance_in_frame(kind, head, x, y, z)
    nx, ny, nz = in_world(head, a, b, c)
    return g, nx, ny, nz


@inlined
def unit(nx, ny, nz):
    """Return the unit vector along a gradient, whose length is below 1 at a mesh's edges; zero for a zero gradient."""
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return (nx / length, ny / length, nz / length) if length > 0.0 else (0.0, 0.0, 0.0)


@inlined
def gap_at(kind, reals, r, px, py, pz):
    """Return the signed distance [m] from a point to the obstacle, and the normal (3,) there, in world axes.

    If the obstacle would push the point out on another side than the entry side, the distance and the normal are those
    of the point's entry plane. At an edge of a rigid body the plane is fixed for the solve.
    """
    g, nx, ny, nz = distance_at(kind, reals, px, py, pz)
    a, b, c = reals[r + PLANE], reals[r + PLANE + 1], reals[r + PLANE + 2]
    if a == 0.0 and b == 0.0 and c == 0.0:
        return g, nx, ny, nz
    ex, ey, ez = in_world(reals, a, b, c)
    if reals[r + FIXED] == 0.0 and nx * ex + ny * ey + nz * ez > 0.0:
        return g, nx, ny, nz
    x, y, z = in_frame(reals, px - reals[ORIGIN], py - reals[ORIGIN + 1], pz - reals[ORIGIN + 2])
    return a * x + b * y + c * z - reals[r + PLANE + 3], ex, ey, ez


@kernel
def distances(points, head, kind, out, normals):
    """Write the signed distances of ``points`` (k, 3) [m] from the obstacle to ``out`` (k,) [m], and normals (k, 3)."""
    for i in range(len(points)):
        found = distance_at(kind, head, points[i, 0], points[i, 1], points[i, 2])
        out[i], normals[i, 0], normals[i, 1], normals[i, 2] = found


@kernel
def entries(starts, ends, reach, head, kind, planes):
    """Write the entry planes (k, 4) of points that move on straight lines from ``starts`` to ``ends`` (k, 3) [m].

    All positions and planes are in the frame. Rows of points that do not enter the obstacle are zero. A point that
    starts nearer than ``reach`` [m] counts as entering only if the obstacle would push it out on the other side at the
    path's end. Each path is sphere-traced: each move is as long as the distance to the obstacle at its start.
    """
    for i in range(len(starts)):
        planes[i] = 0.0
        offset = ends[i] - starts[i]
        length = math.sqrt(offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2])
        gone = 0.0
        for _ in range(MOST_STEPS):
            p = starts[i] + (gone / length) * offset if length > 0.0 else starts[i]
            g, nx, ny, nz = distance_in_frame(kind, head, p[0], p[1], p[2])
            if gone == 0.0 and g < reach:
                _, ex, ey, ez = distance_in_frame(kind, head, ends[i, 0], ends[i, 1], ends[i, 2])
                if nx * ex + ny * ey + nz * ez >= 0.0:
                    break
            if g < reach:
                nx, ny, nz = unit(nx, ny, nz)
                planes[i, 0], planes[i, 1], planes[i, 2] = nx, ny, nz
                planes[i, 3] = nx * p[0] + ny * p[1] + nz * p[2] - g
                break
            gone += g if kind != MESH else SURE * g
            if gone >= length:
                break


@kernel
def nearness(x, quads, gauss, shape, head, kind, out):
    """Add the integral over faces of the error of interpolated obstacle distances to ``out`` (n,) [m^3].

    The error is the distance interpolated between a face's corners, minus the true distance. Each face's integral is
    distributed to its vertices. A face that spans an edge of the obstacle is left out, because the normals at its
    corners differ.
    """
    corner, normal = np.empty(4), np.empty((4, 3))
    for q in range(len(quads)):
        for a in range(4):
            v = quads[q, a]
            corner[a], normal[a, 0], normal[a, 1], normal[a, 2] = distance_at(kind, head, x[v, 0], x[v, 1], x[v, 2])
        mean = np.sqrt(np.square(normal.sum(axis=0)).sum())
        if mean < 4.0 * SMOOTH:
            continue
        for p in range(4):
            px, py, pz, told = 0.0, 0.0, 0.0, 0.0
            for a in range(4):
                w, v = shape[p, a], quads[q, a]
                px, py, pz, told = px + w * x[v, 0], py + w * x[v, 1], pz + w * x[v, 2], told + w * corner[a]
            nearer = gauss[q, p] * (told - distance_at(kind, head, px, py, pz)[0])
            for a in range(4):
                out[quads[q, a]] += shape[p, a] * nearer
