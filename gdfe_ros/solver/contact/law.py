# SPDX-License-Identifier: Apache-2.0
"""Compiled augmented Lagrangian of gaps and Coulomb friction at the points of a surface.

With the gap g, a multiplier l >= 0 and a penalty k, contact has the potential (max(0, l - k g)^2 - l^2) / 2 k.
Minimising it and updating l <- max(0, l - k g) in turn converges to g >= 0, l >= 0, l g = 0 (Rockafellar 1973).
Friction has the Moreau envelope of mu l |s| as its potential. Here s is the slip since the anchor in the contact plane.
With the multiplier t, the trial force t + k s is shortened to mu l and becomes the new t. A point that sticks keeps its
anchor, so sticking contacts do not creep.

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
from gdfe_ros.solver.contact.coulomb import add_friction_tangent, envelope, shortened
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
    PENALTY,
    PRESS,
    RUB,
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
def shear_at(x, reals, integers, i, limit):
    """Return the friction force (3,) [N] on a point, shortened to ``limit`` [N], and the trial force's length [N]."""
    r, (px, py, pz) = HEAD + STRIDE * i, point_at(x, reals, integers, i, integers[RUB])
    k, n0, n1, n2 = reals[r + PENALTY], reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2]
    a0, a1, a2 = in_world(reals, reals[r + ANCHOR], reals[r + ANCHOR + 1], reals[r + ANCHOR + 2])
    dx, dy, dz = px - reals[ORIGIN] - a0, py - reals[ORIGIN + 1] - a1, pz - reals[ORIGIN + 2] - a2
    along = n0 * dx + n1 * dy + n2 * dz
    t0 = reals[r + SHEAR] + k * (dx - along * n0)
    t1 = reals[r + SHEAR + 1] + k * (dy - along * n1)
    t2 = reals[r + SHEAR + 2] + k * (dz - along * n2)
    return shortened(t0, t1, t2, limit)


@kernel
def contact_energy(x, reals, integers, force, size):
    """Return the augmented Lagrangian [J] of all points; add its gradient to ``force``. See `term_kernel`."""
    energy, kind = 0.0, integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, held = reals[r + PENALTY], reals[r + PRESS]
        px, py, pz = point_at(x, reals, integers, i, WEIGHTS)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        press = max(0.0, held - k * (g - reals[r + OFFSET]))
        stored, given = press * press, held * held
        if press > 0.0:
            f0, f1, f2 = -press * nx, -press * ny, -press * nz
            push(reals, integers, i, WEIGHTS, f0, f1, f2, force)
            r0, r1, r2 = in_frame(reals, px - reals[ORIGIN], py - reals[ORIGIN + 1], pz - reals[ORIGIN + 2])
            push_back(reals, integers, f0, f1, f2, r0, r1, r2, force)
        limit = reals[FRICTION] * held
        if limit > 0.0:
            t0, t1, t2, trial = shear_at(x, reals, integers, i, limit)
            push(reals, integers, i, integers[RUB], t0, t1, t2, force)
            r0, r1, r2 = reals[r + ANCHOR], reals[r + ANCHOR + 1], reals[r + ANCHOR + 2]
            push_back(reals, integers, t0, t1, t2, r0, r1, r2, force)
            stored += envelope(trial, limit)
            given += reals[r + SHEAR] ** 2 + reals[r + SHEAR + 1] ** 2 + reals[r + SHEAR + 2] ** 2
        energy += 0.5 * (stored - given) / k
        size[0] += 0.5 * (stored + given) / k
    return energy


@term_kernel
def contact_entry(x, n, reals, k, integers, i, force, size):
    """Call `contact_energy` with the raw pointers that the terms' kernels receive."""
    return contact_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@kernel
def update_multipliers(x, reals, integers):
    """Update the multipliers l and t and the normals.

    Returns:
        Four numbers: the largest error [m] in gap or slip of a point, |change of force| / k; the sum of the changes of
            forces [N]; the sum of the normal forces [N]; the sum of the penalties [N/m] of the points that press.
    """
    miss, kind, changed, held_now, stiff = 0.0, integers[KIND], 0.0, 0.0, 0.0
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, held = reals[r + PENALTY], reals[r + PRESS]
        px, py, pz = point_at(x, reals, integers, i, WEIGHTS)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        press = max(0.0, held - k * (g - reals[r + OFFSET]))
        nx, ny, nz = unit(nx, ny, nz)
        change = abs(press - held)
        t0, t1, t2, _ = shear_at(x, reals, integers, i, reals[FRICTION] * press)
        along = t0 * nx + t1 * ny + t2 * nz
        t0, t1, t2 = t0 - along * nx, t1 - along * ny, t2 - along * nz
        if reals[FRICTION] > 0.0:
            d0, d1, d2 = t0 - reals[r + SHEAR], t1 - reals[r + SHEAR + 1], t2 - reals[r + SHEAR + 2]
            change = max(change, math.sqrt(d0 * d0 + d1 * d1 + d2 * d2))
        miss, changed = max(miss, change / k), changed + change
        if press > 0.0:
            held_now, stiff = held_now + press, stiff + k
        reals[r + PRESS] = press
        reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2] = t0, t1, t2
        reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2] = nx, ny, nz
    return miss, changed, held_now, stiff


@kernel
def contact_forces(x, reals, integers, forces, presses, shears, slips):
    """Write each point's contact force, normal force and friction force [N], and whether it slips."""
    kind = integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        px, py, pz = point_at(x, reals, integers, i, WEIGHTS)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        held = reals[r + PRESS]
        limit = reals[FRICTION] * held
        t0, t1, t2, trial = shear_at(x, reals, integers, i, limit)
        press = max(0.0, held - reals[r + PENALTY] * (g - reals[r + OFFSET]))
        presses[i], slips[i] = press, trial >= limit
        shears[i, 0], shears[i, 1], shears[i, 2] = -t0, -t1, -t2
        forces[i, 0], forces[i, 1], forces[i, 2] = press * nx - t0, press * ny - t1, press * nz - t2


@kernel
def contact_tangents(x, reals, integers, pressed, rubbed):
    """Add the positive semi-definite parts of each point's Hessians to ``pressed`` and ``rubbed`` (k, 3, 3) [N/m].

    ``pressed`` receives the part of the normal force, and ``rubbed`` that of the friction force. Both may be one array.
    """
    kind = integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, held = reals[r + PENALTY], reals[r + PRESS]
        px, py, pz = point_at(x, reals, integers, i, WEIGHTS)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        if held - k * (g - reals[r + OFFSET]) > 0.0:
            normal = (nx, ny, nz)
            for a in range(3):
                for b in range(3):
                    pressed[i, a, b] += k * normal[a] * normal[b]
        limit = reals[FRICTION] * held
        if limit > 0.0:
            t0, t1, t2, trial = shear_at(x, reals, integers, i, limit)
            normal = (reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2])
            add_friction_tangent(k, limit, (t0, t1, t2), trial, normal, rubbed[i])
