# SPDX-License-Identifier: Apache-2.0
"""Contact points as stencils, and their forces during a step of the minimisation.

A contact point is a set of vertices with weights that moves relative to a surface: a plane, a shape, a face or an edge,
of an obstacle, a rigid body or the body itself. Its gap g has the gradient n, and its slip s lies in the plane normal
to n. It has a normal force l n and a friction force -t. Before each step of the minimisation, `complementarity` finds
the forces with which the step satisfies the laws of Signorini and Coulomb. During the step, the forces are constant
vectors on the vertices: the term is the potential of dead loads, sum_a (t w_a' - l n w_a) . x_a, with the weights w of
the gap and w' of the slip. Before the next step, the forces turn with the surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.constraints.distances import ORIGIN, distance_at, in_frame, in_world
from gdfe_ros.materials.tensor import perpendicular
from gdfe_ros.mesh.triples import corner, cross, dot, minus, unit
from gdfe_ros.solver.contact.gap import nearness
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

BESIDE = 0.1
"""A plane ends where its surface does. A point outside of the surface is beside it if its place on the plane is also
outside: at a distance that, divided by the point's distance from the plane, exceeds this.
"""
LOADS = 6
"""Count of each vertex' numbers in the loads: the gradient [N] of the energy of its dead load, and the position [m]
where this energy is 0. The position is renewed before each step, so that energies stay as small as steps.
"""


class Stencils(NamedTuple):
    """The contact points, or pairs, that are near.

    Attributes:
        places: (k, 3) [m] gap, and slip along two tangents.
        axes: (k, 3, 3) gradient of the gap, and the tangents.
        held: (k, 3) [N] present forces along the axes.
        shears: (k, 3) [N] vectors t of the friction forces -t.
        soft: (k,) [m/N] compliance of the spring through which the normal force acts.
        scale: (k,) [N/m] stiffness of the body at each point.
        anchors: (k, 3) [m] places where slips begin, in the frame of the touched surface.
        planes: (k, 4) planes n . q = d in this frame that replace the surface. Except for the kind `PLANES`, n = 0
            stands for no plane.
        fixed: (k,) whether the plane replaces the whole surface. Otherwise it replaces only the parts of the surface
            that push the point out on another side.
        offsets: (k,) [m] subtracted from the distances.
        areas: (k,) [m^2] undeformed area of the faces around each point that correct its offset; 0 for none.
        ends: (k, c) vertices that move the point or the touched surface.
        pressing, rubbing: (k, c) weights of these vertices in the displacements that change the gap, and the slip.
    """

    places: NDArray[np.float64]
    axes: NDArray[np.float64]
    held: NDArray[np.float64]
    shears: NDArray[np.float64]
    soft: NDArray[np.float64]
    scale: NDArray[np.float64]
    anchors: NDArray[np.float64]
    planes: NDArray[np.float64]
    fixed: NDArray[np.bool_]
    offsets: NDArray[np.float64]
    areas: NDArray[np.float64]
    ends: NDArray[np.int32]
    pressing: NDArray[np.float64]
    rubbing: NDArray[np.float64]

    @classmethod
    def blank(cls, count: int, width: int) -> Self:
        """Return stencils of ``count`` points with ``width`` ends each; all numbers are 0."""
        vectors, scalars, weights = np.zeros((4, count, 3)), np.zeros((4, count)), np.zeros((2, count, width))
        places, held, shears, anchors = vectors
        planes, fixed, ends = np.zeros((count, 4)), np.zeros(count, np.bool_), np.zeros((count, width), np.int32)
        frames = places, np.zeros((count, 3, 3)), held, shears, *scalars[:2], anchors
        return cls(*frames, planes, fixed, *scalars[2:], ends, *weights)

    def part(self, first: int, last: int) -> Self:
        """Return views of the points from ``first`` to before ``last``."""
        return type(self)(*(each[first:last] for each in self))

    @classmethod
    def join(cls, parts: Sequence[Stencils], width: int) -> Self:
        """Return the stencils of all ``parts``, with ``width`` ends each; added ends have no weight."""
        found, first = cls.blank(sum(len(part.fixed) for part in parts), width), 0
        for part in parts:
            own, first = found.part(first, first + len(part.fixed)), first + len(part.fixed)
            own.ends[...] = part.ends[:, :1]
            for whole, each in zip(own, part, strict=True):
                whole[tuple(map(slice, each.shape))] = each
        return found

    @property
    def slips(self) -> NDArray[np.float64]:
        """Slips (k, 3) [m]."""
        return np.einsum("ka,kai->ki", self.places[:, 1:], self.axes[:, 1:])

    @property
    def normals(self) -> NDArray[np.float64]:
        """Unit normals (k, 3); zero where the gap has no gradient."""
        length = np.linalg.norm(self.axes[:, 0], axis=1, keepdims=True)
        return self.axes[:, 0] / np.where(length > 0.0, length, 1.0)


PLANES = -1
"""Kind of the surface of the body itself: each point has a plane of its own."""


class Surfaces(NamedTuple):
    """The surfaces that the points of t contacts touch.

    Attributes:
        kind: (t,) kinds of shapes, or `PLANES`.
        own: (t,) number of ends that move a point itself: the first ones.
        turning: (t,) whether a rigid body is touched: its four vertices are the last ends of each point.
        frames: (t, 12) rotation, and origin [m], of each surface.
        vertices: (t, 4) vertices of each rigid body.
        signs: (t, 4, 3) [1/m] factors that give the rotation of each rigid body (`RigidBody.signs`).
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
    def of(cls, kind: int, own: int, form: NDArray[np.float64], *rigid: NDArray) -> Surfaces:
        """Return one surface; ``rigid`` are the vertices (4,) and signs (4, 3) of a rigid body, if it is one."""
        numbers, ends = [np.array([each]) for each in (kind, own, bool(rigid))], np.array([0, len(form)])
        vertices, signs = rigid or (np.zeros(4), np.zeros((4, 3)))
        frames = np.append(np.eye(3), np.zeros(3))[None]
        return cls(*numbers, frames, vertices.astype(np.int64)[None], signs[None].copy(), ends, form)

    @classmethod
    def join(cls, parts: list[Surfaces]) -> Surfaces:
        """Return all surfaces of ``parts``."""
        starts = np.cumsum([0, *(len(part.forms) for part in parts)])
        whole = [np.concatenate([part[k] for part in parts]) for k in range(6)]
        return cls(*whole, starts, np.concatenate([part.forms for part in parts]))


class GapFaces(NamedTuple):
    """Faces between the points of t contacts; their distances from the touched surface correct the points' offsets.

    Attributes:
        start: (t + 1,) offsets of each contact's faces.
        quads: (q, 4) int32 vertices.
        gauss: (q, 4) [m^2] undeformed area of each Gauss point.
    """

    start: NDArray[np.int64]
    quads: NDArray[np.int32]
    gauss: NDArray[np.float64]

    @classmethod
    def join(cls, parts: Sequence[tuple[NDArray[np.int32], NDArray[np.float64]]]) -> GapFaces:
        """Return the faces of all contacts; ``parts`` has the vertices and areas of each contact's faces."""
        starts = np.cumsum([0, *(len(quads) for quads, _ in parts)])
        return cls(starts, *(np.concatenate(each) for each in zip(*parts, strict=True)))


NO_FACES = np.zeros((0, 4), np.int32), np.zeros((0, 4))
"""No faces, and no areas."""
NOTHING_NEAR = Stencils.blank(0, 1), NO_FACES
"""Stencils and faces of a contact without near points."""


@internal
def set_axes(i, gap, gradient, slip, stencils):
    """Write place, axes and forces of a point from its gap, the gap's gradient, and its slip.

    The vector t of the friction force is turned to the new tangents. The normal force keeps its size.
    """
    places, axes, held, shears = stencils.places, stencils.axes, stencils.held, stencils.shears
    normal = unit(gradient)
    first = perpendicular(normal)
    second = cross(normal, first)
    t = shears[i, 0], shears[i, 1], shears[i, 2]
    places[i, 0], places[i, 1], places[i, 2] = gap, dot(first, slip), dot(second, slip)
    held[i, 1], held[i, 2] = -dot(first, t), -dot(second, t)
    for j in range(3):
        axes[i, 0, j], axes[i, 1, j], axes[i, 2, j] = gradient[j], first[j], second[j]
    turn_shear(i, stencils)


@internal
def turn_shear(i, stencils):
    """Write the vector t of a point's friction force from its components along the tangents."""
    held, axes = stencils.held, stencils.axes
    for j in range(3):
        stencils.shears[i, j] = -(held[i, 1] * axes[i, 1, j] + held[i, 2] * axes[i, 2, j])


@internal
def add_load(stencils, i, loads):
    """Add the gradients of a point's dead loads to ``loads`` (n, 6), the loads of all vertices."""
    axes, held = stencils.axes, stencils.held
    for a in range(stencils.ends.shape[1]):
        vertex, w, v = stencils.ends[i, a], stencils.pressing[i, a], stencils.rubbing[i, a]
        for j in range(3):
            rubs = held[i, 1] * axes[i, 1, j] + held[i, 2] * axes[i, 2, j]
            loads[vertex, j] -= w * held[i, 0] * axes[i, 0, j] + v * rubs


@kernel
def add_loads(stencils, loads):
    """Do `add_load` for all points."""
    for i in range(len(stencils.ends)):
        add_load(stencils, i, loads)


@kernel
def take_frames(x, surfaces, frames):
    """Write the frames (t, 12) of rigid bodies with vertices at ``x`` (n, 3) [m]."""
    for t in range(len(surfaces.kind)):
        if not surfaces.turning[t]:
            continue
        frame = frames[t]
        frame[:] = 0.0
        for a in range(4):
            v = surfaces.vertices[t, a]
            for i in range(3):
                frame[ORIGIN + i] += 0.25 * x[v, i]
                for j in range(3):
                    frame[3 * i + j] += x[v, i] * surfaces.signs[t, a, j]


@internal
def place_of(x, ends, weights, i, own):
    """Return the weighted sum (3,) [m] of the first ``own`` ends of a point."""
    p0, p1, p2 = 0.0, 0.0, 0.0
    for a in range(own):
        v, w = ends[i, a], weights[i, a]
        p0, p1, p2 = p0 + w * x[v, 0], p1 + w * x[v, 1], p2 + w * x[v, 2]
    return p0, p1, p2


@internal
def measure_gap(stencils, surfaces, t, i, p):
    """Return the signed distance [m] of a point at ``p`` (3,) from the surface ``t``, and its gradient (3,)."""
    frame, form = surfaces.frames[t], surfaces.forms[surfaces.form_start[t] : surfaces.form_start[t + 1]]
    a, b, c, d = stencils.planes[i, 0], stencils.planes[i, 1], stencils.planes[i, 2], stencils.planes[i, 3]
    if surfaces.kind[t] == PLANES:
        return a * p[0] + b * p[1] + c * p[2] - d, a, b, c
    g, nx, ny, nz = distance_at(surfaces.kind[t], frame, form, p[0], p[1], p[2])
    if a == 0.0 and b == 0.0 and c == 0.0:
        return g, nx, ny, nz
    ex, ey, ez = in_world(frame, a, b, c)
    # If the surface itself pushes the point out on the plane's side, the surface is used.
    if nx * ex + ny * ey + nz * ez > 0.0 and not stencils.fixed[i]:
        return g, nx, ny, nz
    u = in_frame(frame, p[0] - frame[ORIGIN], p[1] - frame[ORIGIN + 1], p[2] - frame[ORIGIN + 2])
    h = a * u[0] + b * u[1] + c * u[2] - d
    if g > 0.0 and not stencils.fixed[i]:
        beside = distance_at(surfaces.kind[t], frame, form, p[0] - h * ex, p[1] - h * ey, p[2] - h * ez)[0]
        if beside > BESIDE * abs(h):
            return g, nx, ny, nz
    return h, ex, ey, ez


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


@internal
def correct_offsets(x, surfaces, faces, owner, stencils):
    """Write the offsets [m] of points with faces around them.

    Between its corners, a flat face comes nearer to a round obstacle than at its corners. The error of a face is the
    distance interpolated between its corners, minus the true distance. The offset of a vertex is the mean of this error
    over the faces around it, at least 0. On a ball the offsets halve the error of the gaps.
    """
    for t in range(len(surfaces.kind)):
        first, last = faces.start[t], faces.start[t + 1]
        if first == last:
            continue
        nearer, form = np.zeros(len(x)), surfaces.forms[surfaces.form_start[t] : surfaces.form_start[t + 1]]
        quads, gauss = faces.quads[first:last], faces.gauss[first:last]
        nearness(x, quads, gauss, surfaces.frames[t], form, surfaces.kind[t], nearer)
        for i in range(len(owner)):
            if owner[i] == t and stencils.areas[i] > 0.0:
                stencils.offsets[i] = max(0.0, nearer[stencils.ends[i, 0]] / stencils.areas[i])


@kernel
def find_stencils(x, surfaces, faces, owner, stencils):
    """Write the stencils of all points; ``owner`` (k,) are the numbers of their surfaces."""
    take_frames(x, surfaces, surfaces.frames)
    correct_offsets(x, surfaces, faces, owner, stencils)
    for i in range(len(owner)):
        find_point(x, surfaces, owner[i], i, stencils)


@kernel
def sum_wrench(x, stencils, own, origin, forces):
    """Return the sum of ``forces`` (k, 3) [N] of points and their moment [N m] about ``origin`` (3,), together (6,).

    The forces act where friction acts: at the weighted sum of the first ``own`` ends.
    """
    found = np.zeros(6)
    for i in range(len(forces)):
        p, f = place_of(x, stencils.ends, stencils.rubbing, i, own), corner(forces, i)
        moment = cross(minus(p, (origin[0], origin[1], origin[2])), f)
        for axis in range(3):
            found[axis] += f[axis]
            found[3 + axis] += moment[axis]
    return found


@kernel
def find_pressing(x, surfaces, owner, stencils, chosen, axes, held, blocks):
    """Write unit axes (c, 3, 3), forces (c, 3) [N] along them, and derivatives of gaps and slips, of ``chosen`` points.

    The derivatives ``blocks`` (c, e, 3, 3) are with respect to the ends. On a touched rigid body, friction acts at the
    points' present places, for vertices at ``x`` (n, 3) [m], not at the places where their slips began.
    """
    for c in range(len(chosen)):
        i = chosen[c]
        t = owner[i]
        own, frame, normal = surfaces.own[t], surfaces.frames[t], corner(stencils.axes[i], 0)
        length = math.sqrt(dot(normal, normal))  # below 1 at edges of a surface of triangles
        q = place_of(x, stencils.ends, stencils.rubbing, i, own)
        u = in_frame(frame, q[0] - frame[ORIGIN], q[1] - frame[ORIGIN + 1], q[2] - frame[ORIGIN + 2])
        for k in range(3):
            share = length if k == 0 else 1.0
            held[c, k] = share * stencils.held[i, k]
            for j in range(3):
                axes[c, k, j] = stencils.axes[i, k, j] / share
        for a in range(stencils.ends.shape[1]):
            rubbing = stencils.rubbing[i, a]
            if surfaces.turning[t] and own <= a < own + 4:
                rubbing = -0.25 - dot(u, corner(surfaces.signs[t], a - own))
            for k in range(3):
                weight = stencils.pressing[i, a] if k == 0 else rubbing
                for j in range(3):
                    blocks[c, a, k, j] = weight * axes[c, k, j]


@kernel
def held_energy(x, reals, integers, force, size):
    """Return the energy [J] of the dead loads; add its gradient to ``force``. See `term_kernel`.

    ``reals`` are the loads of all vertices. ``integers`` is 1 if any load acts, otherwise 0.
    """
    energy = 0.0
    if integers[0] == 0:
        return energy
    for v in range(len(x)):
        first = LOADS * v
        for j in range(3):
            force[v, j] += reals[first + j]
            work = reals[first + j] * (x[v, j] - reals[first + 3 + j])
            energy += work
            size[0] += abs(work)
    return energy


@term_kernel
def held_entry(x, n, reals, k, integers, i, force, size):
    """Call `held_energy` with the raw pointers that the terms' kernels receive."""
    return held_energy(*as_arrays(x, n, reals, k, integers, i, force, size))
