# SPDX-License-Identifier: Apache-2.0
"""Compiled searches on an obstacle: where a point's path enters it, and how much nearer faces come than corners."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import kernel
from gdfe_ros.constraints.distances import MESH, SURE, distance_at, distance_in_frame
from gdfe_ros.mesh.triples import along, corner, dot, minus, unit

MOST_STEPS = 60
"""Largest number of sphere-tracing moves along one path. If they do not reach the obstacle, the path only grazes it."""
SMOOTH = 0.95
"""The obstacle is smooth at a face if the mean of its unit normals at the four corners has at least this length."""


@kernel
def find_entries(starts, ends, reach, radius, form, kind):
    """Return the entry planes (k, 4) of balls whose centres move straight from ``starts`` to ``ends`` (k, 3) [m].

    The balls have the ``radius`` [m], 0 for points. All positions and planes are in the frame. Rows of balls that do
    not enter the obstacle, or move by less than ``reach`` [m], are zero. A ball that starts nearer than ``reach``
    counts as entering only if the obstacle would push it out on the other side at the path's end. Each path is
    sphere-traced: each move is as long as the distance to the obstacle at its start.
    """
    planes = np.zeros((len(starts), 4))
    for i in range(len(starts)):
        start, offset = corner(starts, i), minus(corner(ends, i), corner(starts, i))
        length, gone = math.sqrt(dot(offset, offset)), 0.0
        if not length > reach:
            continue
        for _ in range(MOST_STEPS):
            p = along(1.0, start, gone / length, offset)
            away, nx, ny, nz = distance_in_frame(kind, form, p[0], p[1], p[2])
            g = away - radius
            if gone == 0.0 and g < reach:
                _, ex, ey, ez = distance_in_frame(kind, form, ends[i, 0], ends[i, 1], ends[i, 2])
                if nx * ex + ny * ey + nz * ez >= 0.0:
                    break
            if g < reach:
                n = unit((nx, ny, nz))
                planes[i, 0], planes[i, 1], planes[i, 2], planes[i, 3] = n[0], n[1], n[2], dot(n, p) - away
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
