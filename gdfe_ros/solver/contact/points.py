# SPDX-License-Identifier: Apache-2.0
"""Compiled stencils of the points near obstacles and rigid bodies: gaps, slips, and the axes along which forces act."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.constraints.distances import ORIGIN, distance_at, in_frame, in_world
from gdfe_ros.mesh.triples import dot
from gdfe_ros.solver.contact.stencil import set_axes

PLANES = -1
"""Kind of a surface of which each point has a plane of its own: that of the body itself."""


class Surfaces(NamedTuple):
    """What the points of t contacts touch.

    Attributes:
        kind: (t,) kinds of shapes, or `PLANES`.
        own: (t,) number of the ends of a point that move the point itself.
        turning: (t,) whether a rigid body is touched: its four vertices are the last ends of each point.
        frames: (t, 12) rotation, and origin [m], of each surface.
        vertices: (t, 4) vertices of each rigid body.
        signs: (t, 4, 3) [1/m] factors that give its rotation (`RigidBody.signs`).
        form_start: (t + 1,) offsets of the numbers of each shape in ``forms``.
        forms: numbers of all shapes (`gap.form_numbers`).
    """

    kind: NDArray[np.int64]
    own: NDArray[np.int64]
    turning: NDArray[np.bool_]
    frames: NDArray[np.float64]
    vertices: NDArray[np.int64]
    signs: NDArray[np.float64]
    form_start: NDArray[np.int64]
    forms: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        kind: int,
        own: int,
        form: NDArray[np.float64],
        vertices: NDArray[np.int32] | None = None,
        signs: NDArray[np.float64] | None = None,
    ) -> Surfaces:
        """Return one surface; ``vertices`` and ``signs`` are those of a rigid body."""
        turning = vertices is not None
        four = np.asarray(vertices, dtype=np.int64) if turning else np.zeros(4, dtype=np.int64)
        turns = signs if turning else np.zeros((4, 3))
        numbers, ends = [np.array([each]) for each in (kind, own, turning)], np.array([0, len(form)])
        frames = np.append(np.eye(3), np.zeros(3))[None]
        return cls(*numbers, frames, four[None], turns[None].copy(), ends, form)

    @classmethod
    def join(cls, parts: list[Surfaces]) -> Surfaces:
        """Return all surfaces of ``parts``."""
        starts = np.cumsum([0, *(len(part.forms) for part in parts)])
        whole = [np.concatenate([part[k] for part in parts]) for k in range(6)]
        return cls(*whole, starts, np.concatenate([part.forms for part in parts]))


@internal
def take_frames(x, surfaces):
    """Write the frames of rigid bodies with vertices at ``x`` (n, 3) [m]."""
    for t in range(len(surfaces.kind)):
        if not surfaces.turning[t]:
            continue
        frame = surfaces.frames[t]
        frame[:] = 0.0
        for a in range(4):
            v = surfaces.vertices[t, a]
            for i in range(3):
                frame[ORIGIN + i] += 0.25 * x[v, i]
                for j in range(3):
                    frame[3 * i + j] += x[v, i] * surfaces.signs[t, a, j]


@internal
def place_of(x, ends, weights, i, own):
    """Return the mean (3,) [m] of the first ``own`` ends of a point with its weights."""
    p0, p1, p2 = 0.0, 0.0, 0.0
    for a in range(own):
        v, w = ends[i, a], weights[i, a]
        p0, p1, p2 = p0 + w * x[v, 0], p1 + w * x[v, 1], p2 + w * x[v, 2]
    return p0, p1, p2


@internal
def measure_gap(stencils, surfaces, t, i, p):
    """Return the signed distance [m] of a point at ``p`` (3,) from what it touches, and its gradient (3,)."""
    frame, form = surfaces.frames[t], surfaces.forms[surfaces.form_start[t] : surfaces.form_start[t + 1]]
    a, b, c, d = stencils.planes[i, 0], stencils.planes[i, 1], stencils.planes[i, 2], stencils.planes[i, 3]
    if surfaces.kind[t] == PLANES:
        return a * p[0] + b * p[1] + c * p[2] - d, a, b, c
    g, nx, ny, nz = distance_at(surfaces.kind[t], frame, form, p[0], p[1], p[2])
    if a == 0.0 and b == 0.0 and c == 0.0:
        return g, nx, ny, nz
    ex, ey, ez = in_world(frame, a, b, c)
    # Where the surface pushes the point out on the plane's side itself, it serves.
    if nx * ex + ny * ey + nz * ez > 0.0 and not stencils.fixed[i]:
        return g, nx, ny, nz
    u = in_frame(frame, p[0] - frame[ORIGIN], p[1] - frame[ORIGIN + 1], p[2] - frame[ORIGIN + 2])
    return a * u[0] + b * u[1] + c * u[2] - d, ex, ey, ez


@internal
def find_point(x, surfaces, t, i, stencils):
    """Write the stencil of point ``i``, which may touch surface ``t``; its forces turn with the surface."""
    own, frame = surfaces.own[t], surfaces.frames[t]
    p, q = place_of(x, stencils.ends, stencils.pressing, i, own), place_of(x, stencils.ends, stencils.rubbing, i, own)
    g, nx, ny, nz = measure_gap(stencils, surfaces, t, i, p)
    anchor = stencils.anchors[i, 0], stencils.anchors[i, 1], stencils.anchors[i, 2]
    if surfaces.turning[t]:
        u = in_frame(frame, p[0] - frame[ORIGIN], p[1] - frame[ORIGIN + 1], p[2] - frame[ORIGIN + 2])
        for a in range(4):
            sign = surfaces.signs[t, a, 0], surfaces.signs[t, a, 1], surfaces.signs[t, a, 2]
            stencils.pressing[i, own + a] = -0.25 - dot(u, sign)
            stencils.rubbing[i, own + a] = -0.25 - dot(anchor, sign)
    began = in_world(frame, anchor[0], anchor[1], anchor[2])
    s0, s1 = q[0] - frame[ORIGIN] - began[0], q[1] - frame[ORIGIN + 1] - began[1]
    slip = s0, s1, q[2] - frame[ORIGIN + 2] - began[2]
    set_axes(i, g - stencils.offsets[i], (nx, ny, nz), slip, stencils)


@kernel
def find_stencils(x, surfaces, owner, stencils):
    """Write the stencils of all points; ``owner`` (k,) are the numbers of their surfaces."""
    take_frames(x, surfaces)
    for i in range(len(owner)):
        find_point(x, surfaces, owner[i], i, stencils)
