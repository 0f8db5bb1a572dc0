# SPDX-License-Identifier: Apache-2.0
"""Compiled searches on an obstacle: points near it, places where paths enter it, and the error of gaps on faces."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.actuators.load import GAUSS
from gdfe_ros.compiled import internal, kernel
from gdfe_ros.constraints.distances import MESH, ORIGIN, SURE, distance_at, distance_in_frame, in_frame, measure
from gdfe_ros.mesh.triples import along, corner, dot, minus, unit

MOST_STEPS = 60
"""Largest number of sphere-tracing moves along one path. If they do not reach the obstacle, the path only grazes it."""
SMOOTH = 0.95
"""The obstacle is smooth at a face if the mean of its unit normals at the four corners has at least this length."""


SIGNS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SHAPE = np.stack([0.25 * (1.0 + GAUSS * SIGNS * point).prod(axis=1) for point in SIGNS])
"""(4, 4) weights of a face's corners at each of its Gauss points."""


@internal
def find_places(x, carriers, weights, frame):
    """Return the positions (k, 3) [m] of weighted sums of vertices, in the world and in ``frame`` (12,)."""
    places, within = np.zeros((len(carriers), 3)), np.empty((len(carriers), 3))
    for i in range(len(carriers)):
        for a in range(carriers.shape[1]):
            for axis in range(3):
                places[i, axis] += weights[i, a] * x[carriers[i, a], axis]
        p = minus(corner(places, i), (frame[ORIGIN], frame[ORIGIN + 1], frame[ORIGIN + 2]))
        within[i, 0], within[i, 1], within[i, 2] = in_frame(frame, p[0], p[1], p[2])
    return places, within


@kernel
def find_close(x, last, carriers, weights, frame, before, form, kind, radius, entry, reach, entered, pressed, left_out):
    """Find the points that are near an obstacle, have a force on it, or enter it in a step.

    The points are weighted sums of vertices, and centres of balls with a ``radius`` [m]. The vertices are at ``x`` (n,
    3) [m], and were at ``last`` (n, 3) [m] when the step began; ``frame`` and ``before`` (12,) are the obstacle's
    frames at both times. ``form`` has the numbers of the obstacle's shape, which is of a ``kind``. A point counts as
    near if its distance is below ``reach`` [m], if it has a force ``pressed`` (k,) [N], or if it has an entry plane.
    Points in ``left_out`` (k,) never count as near. ``entry`` [m] is the least distance of `find_entries`. Rows of
    ``entered`` (k, 4) that are not 0 are known entry planes.

    Returns:
        Positions (k, 3) [m], distances (k,) [m] and their gradients (k, 3), positions (k, 3) [m] at the beginning of
        the step in the obstacle's frame, entry planes (k, 4), and the indices of the near points.
    """
    began, (places, within) = find_places(last, carriers, weights, before)[1], find_places(x, carriers, weights, frame)
    planes = find_entries(began, within, entry, radius, form, kind)
    distances, normals = measure(places, frame, form, kind)
    near, count = np.empty(len(places), np.int64), 0
    for i in range(len(places)):
        distances[i] -= radius
        if entered[i].any():
            planes[i] = entered[i]
        enters = planes[i, 0] != 0.0 or planes[i, 1] != 0.0 or planes[i, 2] != 0.0
        if (distances[i] < reach or pressed[i] > 0.0 or enters) and not left_out[i]:
            near[count] = i
            count += 1
    return places, distances, normals, began, planes, near[:count].copy()


@kernel
def find_entries(starts, ends, reach, radius, form, kind):
    """Return the entry planes (k, 4) of balls whose centres move straight from ``starts`` to ``ends`` (k, 3) [m].

    The balls have the ``radius`` [m], 0 for points. All positions and planes are in the obstacle's frame. Rows of balls
    that do not enter the obstacle, or move by less than ``reach`` [m], are zero. A ball that starts nearer than
    ``reach`` counts as entering only if the obstacle would push it out on the other side at the path's end. Each path
    is sphere-traced: each move is as long as the distance to the obstacle at its start.
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
def nearness(x, quads, gauss, frame, form, kind, out):
    """Integrate the error of interpolated obstacle distances over faces; add the integrals to ``out`` (n,) [m^3].

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
            place, distance = (0.0, 0.0, 0.0), 0.0
            for a in range(4):
                place = along(1.0, place, SHAPE[p, a], corner(x, quads[q, a]))
                distance += SHAPE[p, a] * away[a]
            nearer = gauss[q, p] * (distance - distance_at(kind, frame, form, place[0], place[1], place[2])[0])
            for a in range(4):
                out[quads[q, a]] += SHAPE[p, a] * nearer
