# SPDX-License-Identifier: Apache-2.0
"""Compiled contact forces at the points of a surface.

Each point has a normal force l along the gradient of its gap g, and a friction force -t against its slip s since the
anchor, in the contact plane. While a step is made, both are held: the term is the potential -l g + t . s, up to a
constant. Before each
step, `complementarity` finds the forces with which the step keeps the laws of Signorini and Coulomb. A point that
sticks keeps its anchor, so sticking contacts do not creep.

The gap of a vertex is its distance to the obstacle minus its ``offset`` (at least 0). Between its corners, a flat face
comes nearer to a round obstacle than at its corners. The error of a face is the distance interpolated between its
corners, minus the true distance. The offset is the mean of this error over the faces around the vertex. On a ball the
offset halves the error of the gaps.

Friction acts on the material point that touches. This is the point itself, except for round rigid bodies: a ball
touches when its centre is one radius away. The normal force acts at the centre, so the gap is exact for every rotation
of the ball, and the offset is the radius. The friction force acts on the material point that touched when the step
began, c + R q with q = -r R^T n. While the ball rolls by the angle theta in a step, that point slips by r theta^3 / 6
only. A capsule is a row of such balls.

A point is one of three things: a vertex, a skin point carried by the eight vertices of a cell, or a point carried by
the four vertices of a rigid body. The frame of the touched obstacle is prescribed, or is that of a rigid body. The four
vertices of a rigid body are corners of a box around its centre of mass c. Let s_a be the signs of these corners divided
by four times the half edges. Then the rotation is R = sum_a x_a s_a^T, and c = mean x_a. Both are linear in the
positions, so forces on the vertices follow directly.
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.materials.tensor import perpendicular
from gdfe_ros.mesh.triples import cross
from gdfe_ros.solver.contact.gap import (
    ANCHOR,
    BODY,
    CARRIERS,
    COUNT,
    FRICTION,
    HEAD,
    KIND,
    NORMAL,
    OFFSET,
    ORIGIN,
    PRESS,
    RUB,
    SCALE,
    SHEAR,
    SIGNS,
    STRIDE,
    VERTICES,
    WEIGHTS,
    gap_at,
    in_frame,
    in_world,
    point_at,
    take_frame,
    unit,
)
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

ROUNDING = 1e-9
"""A point slips if its friction force is below Coulomb's limit by less than this fraction."""


@inlined
def shortened(t0, t1, t2, limit):
    """Return the trial friction force t (3,) [N] shortened to at most ``limit`` [N]."""
    trial = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    share = limit / trial if trial > limit else 1.0
    return share * t0, share * t1, share * t2


@inlined
def push(reals, integers, i, weights, f0, f1, f2, force):
    """Add the gradient f = dE/dp [N] of a point, times its weights, to ``force`` (n, 3) [N] at the point's carriers.

    The ``weights`` are those that begin there in the point's row.
    """
    count = integers[CARRIERS]
    first = VERTICES + count * i
    for a in range(count):
        w, v = reals[HEAD + STRIDE * i + weights + a], integers[first + a]
        force[v, 0] += w * f0
        force[v, 1] += w * f1
        force[v, 2] += w * f2


@inlined
def push_back(reals, integers, f0, f1, f2, r0, r1, r2, force):
    """Subtract the gradient f = dE/dp [N] of a point from ``force`` (n, 3) [N] at the touched rigid body's vertices.

    ``r`` [m] is p - c in the frame. A prescribed frame has no vertices, so nothing is subtracted.
    """
    if integers[BODY] < 0:
        return
    for a in range(4):
        v, s = integers[BODY + a], SIGNS + 3 * a
        w = 0.25 + r0 * reals[s] + r1 * reals[s + 1] + r2 * reals[s + 2]
        force[v, 0] -= w * f0
        force[v, 1] -= w * f1
        force[v, 2] -= w * f2


@inlined
def slip_at(x, reals, integers, i):
    """Return the displacement (3,) [m] of a point from its anchor, which moves with the obstacle, in world axes."""
    r, (px, py, pz) = HEAD + STRIDE * i, point_at(x, reals, integers, i, integers[RUB])
    a0, a1, a2 = in_world(reals, reals[r + ANCHOR], reals[r + ANCHOR + 1], reals[r + ANCHOR + 2])
    return px - reals[ORIGIN] - a0, py - reals[ORIGIN + 1] - a1, pz - reals[ORIGIN + 2] - a2


@kernel
def contact_energy(x, reals, integers, force, size):
    """Return the work -l g + t . s [J] of the held forces; add its gradient to ``force``. See `term_kernel`."""
    energy, kind = 0.0, integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        press, t0, t1, t2 = reals[r + PRESS], reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2]
        if press == 0.0:
            continue
        px, py, pz = point_at(x, reals, integers, i, WEIGHTS)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        f0, f1, f2 = -press * nx, -press * ny, -press * nz
        push(reals, integers, i, WEIGHTS, f0, f1, f2, force)
        r0, r1, r2 = in_frame(reals, px - reals[ORIGIN], py - reals[ORIGIN + 1], pz - reals[ORIGIN + 2])
        push_back(reals, integers, f0, f1, f2, r0, r1, r2, force)
        work = -press * g  # an offset only shifts the energy
        energy += work
        size[0] += abs(work)
        if t0 != 0.0 or t1 != 0.0 or t2 != 0.0:
            push(reals, integers, i, integers[RUB], t0, t1, t2, force)
            r0, r1, r2 = reals[r + ANCHOR], reals[r + ANCHOR + 1], reals[r + ANCHOR + 2]
            push_back(reals, integers, t0, t1, t2, r0, r1, r2, force)
            s0, s1, s2 = slip_at(x, reals, integers, i)
            work = t0 * s0 + t1 * s1 + t2 * s2
            energy += work
            size[0] += abs(work)
    return energy


@term_kernel
def contact_entry(x, n, reals, k, integers, i, force, size):
    """Call `contact_energy` with the raw pointers that the terms' kernels receive."""
    return contact_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@kernel
def project_forces(x, reals, integers):
    """Replace the forces and normals by those of the projections of `complementarity`, at positions ``x`` (n, 3) [m].

    The forces of a solution do not change. Sensitivities differentiate the projections.
    """
    kind = integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, held = reals[r + SCALE], reals[r + PRESS]
        px, py, pz = point_at(x, reals, integers, i, WEIGHTS)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        press = max(0.0, held - k * (g - reals[r + OFFSET]))
        n0, n1, n2 = reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2]
        s0, s1, s2 = slip_at(x, reals, integers, i)
        along = n0 * s0 + n1 * s1 + n2 * s2
        t0 = reals[r + SHEAR] + k * (s0 - along * n0)
        t1 = reals[r + SHEAR + 1] + k * (s1 - along * n1)
        t2 = reals[r + SHEAR + 2] + k * (s2 - along * n2)
        t0, t1, t2 = shortened(t0, t1, t2, reals[FRICTION] * press)
        nx, ny, nz = unit(nx, ny, nz)
        along = t0 * nx + t1 * ny + t2 * nz
        t0, t1, t2 = t0 - along * nx, t1 - along * ny, t2 - along * nz
        reals[r + PRESS] = press
        reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2] = t0, t1, t2
        reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2] = nx, ny, nz


@kernel
def contact_forces(x, reals, integers, forces, presses, shears, slips):
    """Write each point's contact force, normal force and friction force [N], and whether it slips."""
    kind = integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        px, py, pz = point_at(x, reals, integers, i, WEIGHTS)
        _, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        press, t0, t1, t2 = reals[r + PRESS], reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2]
        limit = reals[FRICTION] * press
        presses[i], slips[i] = press, math.sqrt(t0 * t0 + t1 * t1 + t2 * t2) >= (1.0 - ROUNDING) * limit
        shears[i, 0], shears[i, 1], shears[i, 2] = -t0, -t1, -t2
        forces[i, 0], forces[i, 1], forces[i, 2] = press * nx - t0, press * ny - t1, press * nz - t2


@inlined
def put_tangents(i, normal, s, t, places, axes, held):
    """Write two tangents of point ``i``, and the components of its slip s [m] and friction force -t [N] along them."""
    first = perpendicular(normal)
    second = cross(normal, first)
    for j in range(3):
        axes[i, 1, j], axes[i, 2, j] = first[j], second[j]
    places[i, 1] = first[0] * s[0] + first[1] * s[1] + first[2] * s[2]
    places[i, 2] = second[0] * s[0] + second[1] * s[1] + second[2] * s[2]
    held[i, 1] = -(first[0] * t[0] + first[1] * t[1] + first[2] * t[2])
    held[i, 2] = -(second[0] * t[0] + second[1] * t[1] + second[2] * t[2])


@kernel
def stencils(x, reals, integers, places, axes, held, soft, ends, pressing, rubbing):
    """Write what the complementarity problem needs of each point at positions ``x`` (n, 3) [m]: see `Stencils`."""
    kind, carriers = integers[KIND], integers[CARRIERS]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        px, py, pz = point_at(x, reals, integers, i, WEIGHTS)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        places[i, 0], held[i, 0], soft[i] = g - reals[r + OFFSET], reals[r + PRESS], 0.0
        axes[i, 0, 0], axes[i, 0, 1], axes[i, 0, 2] = nx, ny, nz
        t = reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2]
        put_tangents(i, unit(nx, ny, nz), slip_at(x, reals, integers, i), t, places, axes, held)
        for a in range(carriers):
            ends[i, a] = integers[VERTICES + carriers * i + a]
            pressing[i, a] = reals[r + WEIGHTS + a] if carriers > 1 else 1.0
            rubbing[i, a] = reals[r + integers[RUB] + a] if carriers > 1 else 1.0
        if integers[BODY] >= 0:
            q0, q1, q2 = in_frame(reals, px - reals[ORIGIN], py - reals[ORIGIN + 1], pz - reals[ORIGIN + 2])
            a0, a1, a2 = reals[r + ANCHOR], reals[r + ANCHOR + 1], reals[r + ANCHOR + 2]
            for a in range(4):
                k = SIGNS + 3 * a
                ends[i, carriers + a] = integers[BODY + a]
                pressing[i, carriers + a] = -(0.25 + q0 * reals[k] + q1 * reals[k + 1] + q2 * reals[k + 2])
                rubbing[i, carriers + a] = -(0.25 + a0 * reals[k] + a1 * reals[k + 1] + a2 * reals[k + 2])


@kernel
def hold_forces(axes, forces, reals, integers):
    """Set the forces of all points to ``forces`` (k, 3) [N] along ``axes`` (k, 3, 3), and the normals to the axes'."""
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        reals[r + PRESS] = forces[i, 0]
        normal = unit(axes[i, 0, 0], axes[i, 0, 1], axes[i, 0, 2])
        for j in range(3):
            reals[r + SHEAR + j] = -(forces[i, 1] * axes[i, 1, j] + forces[i, 2] * axes[i, 2, j])
            reals[r + NORMAL + j] = normal[j]
