# SPDX-License-Identifier: Apache-2.0
"""Compiled distances from contact points to obstacles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.constraints.form import Form
from gdfe_ros.mesh.triples import along, combine, corner, dot, minus
from gdfe_ros.solver.contact.distance import MESH, signed_distance
from gdfe_ros.solver.contact.grid import SURE, grid_distance

ORIGIN = 9
"""Offset of the origin [m] in a ``frame`` (12,), after its rotation."""
MOST_STEPS = 60
"""Largest number of sphere-tracing moves along one path. If they do not reach the obstacle, the path only grazes it."""
SMOOTH = 0.95
"""The obstacle is smooth at a face if the mean of its unit normals at the four corners has at least this length."""


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


@inlined
def unit(nx, ny, nz):
    """Return the unit vector along a gradient, whose length is below 1 at a mesh's edges; zero for a zero gradient."""
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return (nx / length, ny / length, nz / length) if length > 0.0 else (0.0, 0.0, 0.0)


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


@kernel
def find_entries(starts, ends, reach, form, kind):
    """Return the entry planes (k, 4) of points that move on straight lines from ``starts`` to ``ends`` (k, 3) [m].

    All positions and planes are in the frame. Rows of points that do not enter the obstacle, or move by less than
    ``reach`` [m], are zero. A point that starts nearer than ``reach`` counts as entering only if the obstacle would
    push it out on the other side at the path's end. Each path is sphere-traced: each move is as long as the distance to
    the obstacle at its start.
    """
    planes = np.zeros((len(starts), 4))
    for i in range(len(starts)):
        start, offset = corner(starts, i), minus(corner(ends, i), corner(starts, i))
        length, gone = math.sqrt(dot(offset, offset)), 0.0
        if not length > reach:
            continue
        for _ in range(MOST_STEPS):
            p = along(1.0, start, gone / length, offset)
            g, nx, ny, nz = distance_in_frame(kind, form, p[0], p[1], p[2])
            if gone == 0.0 and g < reach:
                _, ex, ey, ez = distance_in_frame(kind, form, ends[i, 0], ends[i, 1], ends[i, 2])
                if nx * ex + ny * ey + nz * ez >= 0.0:
                    break
            if g < reach:
                n = unit(nx, ny, nz)
                planes[i, 0], planes[i, 1], planes[i, 2], planes[i, 3] = n[0], n[1], n[2], dot(n, p) - g
                break
            gone += g if kind != MESH else SURE * g
            if gone >= length:
                break
    return planes


@kernel
def nearness(x, quads, gauss, shape, frame, form, kind, out):
    """Add the integral over faces of the error of interpolated obstacle distances to ``out`` (n,) [m^3].

    The error is the distance interpolated between a face's corners, minus the true distance. Each face's integral is
    distributed to its vertices. A face that spans an edge of the obstacle is left out, because the normals at its
    corners differ.
    """
    away = np.empty(4)
    for q in range(len(quads)):
        normal = 0.0, 0.0, 0.0
        for a in range(4):
            place = corner(x, quads[q, a])
            away[a], nx, ny, nz = distance_at(kind, frame, form, place[0], place[1], place[2])
            normal = along(1.0, normal, 1.0, (nx, ny, nz))
        if math.sqrt(dot(normal, normal)) < 4.0 * SMOOTH:
            continue
        for p in range(4):
            place, told = (0.0, 0.0, 0.0), 0.0
            for a in range(4):
                place, told = along(1.0, place, shape[p, a], corner(x, quads[q, a])), told + shape[p, a] * away[a]
            nearer = gauss[q, p] * (told - distance_at(kind, frame, form, place[0], place[1], place[2])[0])
            for a in range(4):
                out[quads[q, a]] += shape[p, a] * nearer
