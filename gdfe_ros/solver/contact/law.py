# SPDX-License-Identifier: Apache-2.0
"""The augmented Lagrangian of gaps and of Coulomb friction at the vertices of a surface, compiled.

With the gap g, a multiplier l >= 0 and a penalty k, contact has the potential (max(0, l - k g)^2 - l^2) / 2 k, whose
minimum with all else and l <- max(0, l - k g) in turn reach g >= 0, l >= 0, l g = 0 (Rockafellar 1973). Friction has
the Moreau envelope of mu l |s|: with the slip s in the plane of contact since the anchor and the multiplier t, the
trial t + k s is shortened to mu l, and t <- that. A vertex that sticks keeps its anchor: nothing creeps.

The gap of a vertex is its distance from the obstacle, less its ``offset``: by how much nearer the faces about it are on
average than distances interpolated from their corners would tell. About a ball, where faces are chords, that halves
the error of gaps that are taken at vertices alone; a vertex itself never comes nearer than that.

A point is a vertex, or hangs on four vertices that a rigid body is; the frame of what is touched is given, or that of
such a body. Its four vertices are corners of a box about its centre of mass c, and with the signs s_a of these corners
over four times its half edges R = sum_a x_a s_a^T, c = mean x_a: both are linear in the positions, and so forces are.
"""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.solver.contact.distance import signed_distance
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

AXES, ORIGIN, NUMBERS, FRICTION, SIGNS, HEAD = 0, 9, 12, 15, 16, 28
"""Where rotation, origin [m], the form's numbers, the coefficient and s_a (4, 3) [1/m] lie, and where points begin."""
PENALTY, PRESS, SHEAR, ANCHOR, NORMAL, OFFSET, WEIGHTS, STRIDE = 0, 1, 2, 5, 8, 11, 12, 16
"""Of each point: k [N/m], l [N], t [N] (3,), anchor [m] (3,) in the frame, normal (3,), offset [m], weights (4,)."""
KIND, COUNT, CARRIERS, BODY, VERTICES = 0, 1, 2, 3, 7
"""Where the form's kind, the number of points, of vertices that carry each, and the four of the frame (-1 where it is
given) lie, and where those of the points begin."""


SMOOTH = 0.95
"""Length of the mean of an obstacle's normals at a face's corners above which it counts as smooth there."""


@inlined
def take_frame(x, reals, integers):
    """Take rotation and origin from the vertices that are the frame; leave them where they are given."""
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
def point_at(x, reals, integers, i):
    """Return where a point is."""
    count = integers[CARRIERS]
    first = VERTICES + count * i
    if count == 1:
        v = integers[first]
        return x[v, 0], x[v, 1], x[v, 2]
    px, py, pz, weights = 0.0, 0.0, 0.0, HEAD + STRIDE * i + WEIGHTS
    for a in range(count):
        w, v = reals[weights + a], integers[first + a]
        px, py, pz = px + w * x[v, 0], py + w * x[v, 1], pz + w * x[v, 2]
    return px, py, pz


@inlined
def push(reals, integers, i, f0, f1, f2, force):
    """Add dE/dp [N] of a point to ``force`` (n, 3)."""
    count = integers[CARRIERS]
    first = VERTICES + count * i
    for a in range(count):
        w, v = reals[HEAD + STRIDE * i + WEIGHTS + a], integers[first + a]
        force[v, 0] += w * f0
        force[v, 1] += w * f1
        force[v, 2] += w * f2


@inlined
def push_back(reals, integers, f0, f1, f2, r0, r1, r2, force):
    """Add to ``force`` (n, 3) what -dE/dp does to the vertices that are the frame; ``r`` is p - c in it."""
    if integers[BODY] < 0:
        return
    for a in range(4):
        v, s = integers[BODY + a], SIGNS + 3 * a
        w = 0.25 + r0 * reals[s] + r1 * reals[s + 1] + r2 * reals[s + 2]
        force[v, 0] -= w * f0
        force[v, 1] -= w * f1
        force[v, 2] -= w * f2


@inlined
def in_frame(head, dx, dy, dz):
    """Return a vector in the axes of the frame."""
    return (
        head[0] * dx + head[3] * dy + head[6] * dz,
        head[1] * dx + head[4] * dy + head[7] * dz,
        head[2] * dx + head[5] * dy + head[8] * dz,
    )


@inlined
def in_world(head, a, b, c):
    """Return a vector of the frame in world axes."""
    return (
        head[0] * a + head[1] * b + head[2] * c,
        head[3] * a + head[4] * b + head[5] * c,
        head[6] * a + head[7] * b + head[8] * c,
    )


@inlined
def distance_at(kind, head, px, py, pz):
    """Return the distance [m] of a point from the obstacle, and the normal there, in world axes."""
    x, y, z = in_frame(head, px - head[ORIGIN], py - head[ORIGIN + 1], pz - head[ORIGIN + 2])
    g, a, b, c = signed_distance(kind, head[NUMBERS], head[NUMBERS + 1], head[NUMBERS + 2], x, y, z)
    nx, ny, nz = in_world(head, a, b, c)
    return g, nx, ny, nz


@inlined
def shear_at(reals, r, px, py, pz, limit):
    """Return the shear [N] that friction up to ``limit`` [N] holds at a point, and the length of its trial."""
    k, n0, n1, n2 = reals[r + PENALTY], reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2]
    a0, a1, a2 = in_world(reals, reals[r + ANCHOR], reals[r + ANCHOR + 1], reals[r + ANCHOR + 2])
    dx, dy, dz = px - reals[ORIGIN] - a0, py - reals[ORIGIN + 1] - a1, pz - reals[ORIGIN + 2] - a2
    along = n0 * dx + n1 * dy + n2 * dz
    t0 = reals[r + SHEAR] + k * (dx - along * n0)
    t1 = reals[r + SHEAR + 1] + k * (dy - along * n1)
    t2 = reals[r + SHEAR + 2] + k * (dz - along * n2)
    trial = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    share = limit / trial if trial > limit else 1.0
    return share * t0, share * t1, share * t2, trial


@kernel
def contact_energy(x, reals, integers, force, size):
    """Return the energy [J] of all points; `term_kernel` wants this signature."""
    energy, kind = 0.0, integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, held = reals[r + PENALTY], reals[r + PRESS]
        px, py, pz = point_at(x, reals, integers, i)
        g, nx, ny, nz = distance_at(kind, reals, px, py, pz)
        press = max(0.0, held - k * (g - reals[r + OFFSET]))
        stored, given = press * press, held * held
        if press > 0.0:
            f0, f1, f2 = -press * nx, -press * ny, -press * nz
            push(reals, integers, i, f0, f1, f2, force)
            r0, r1, r2 = in_frame(reals, px - reals[ORIGIN], py - reals[ORIGIN + 1], pz - reals[ORIGIN + 2])
            push_back(reals, integers, f0, f1, f2, r0, r1, r2, force)
        limit = reals[FRICTION] * held
        if limit > 0.0:
            t0, t1, t2, trial = shear_at(reals, r, px, py, pz, limit)
            push(reals, integers, i, t0, t1, t2, force)
            r0, r1, r2 = reals[r + ANCHOR], reals[r + ANCHOR + 1], reals[r + ANCHOR + 2]
            push_back(reals, integers, t0, t1, t2, r0, r1, r2, force)
            stored += trial * trial if trial <= limit else limit * (2.0 * trial - limit)
            given += reals[r + SHEAR] ** 2 + reals[r + SHEAR + 1] ** 2 + reals[r + SHEAR + 2] ** 2
        energy += 0.5 * (stored - given) / k
        size[0] += 0.5 * (stored + given) / k
    return energy


@term_kernel
def contact_entry(x, n, reals, k, integers, i, force, size):
    """Stand for `contact_energy` among the terms."""
    return contact_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@kernel
def update_multipliers(x, reals, integers):
    """Update l, t and the normals.

    Returns:
        By how far [m] a point missed its gap or slipped against its multiplier, at most; the forces [N] that were
        changed, and those that there are now; the penalties [N/m] where there are.
    """
    miss, kind, changed, held_now, stiff = 0.0, integers[KIND], 0.0, 0.0, 0.0
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, held = reals[r + PENALTY], reals[r + PRESS]
        px, py, pz = point_at(x, reals, integers, i)
        g, nx, ny, nz = distance_at(kind, reals, px, py, pz)
        press = max(0.0, held - k * (g - reals[r + OFFSET]))
        change = abs(press - held)
        t0, t1, t2, _ = shear_at(reals, r, px, py, pz, reals[FRICTION] * press)
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
    """Write of each point the force on it, what of it presses, its shear [N], and whether it slips."""
    kind = integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        px, py, pz = point_at(x, reals, integers, i)
        g, nx, ny, nz = distance_at(kind, reals, px, py, pz)
        held = reals[r + PRESS]
        limit = reals[FRICTION] * held
        t0, t1, t2, trial = shear_at(reals, r, px, py, pz, limit)
        press = max(0.0, held - reals[r + PENALTY] * (g - reals[r + OFFSET]))
        presses[i], slips[i] = press, trial >= limit
        shears[i, 0], shears[i, 1], shears[i, 2] = -t0, -t1, -t2
        forces[i, 0], forces[i, 1], forces[i, 2] = press * nx - t0, press * ny - t1, press * nz - t2


@kernel
def contact_tangents(x, reals, integers, out):
    """Write what of the second derivative [N/m] in the points is nowhere negative, (k, 3, 3)."""
    kind = integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, held = reals[r + PENALTY], reals[r + PRESS]
        px, py, pz = point_at(x, reals, integers, i)
        g, nx, ny, nz = distance_at(kind, reals, px, py, pz)
        if held - k * (g - reals[r + OFFSET]) > 0.0:
            normal = (nx, ny, nz)
            for a in range(3):
                for b in range(3):
                    out[i, a, b] = k * normal[a] * normal[b]
        limit = reals[FRICTION] * held
        if limit > 0.0:
            _, _, _, trial = shear_at(reals, r, px, py, pz, limit)
            share = k * limit / trial if trial > limit else k
            for a in range(3):
                out[i, a, a] += share
                for b in range(3):
                    out[i, a, b] -= share * reals[r + NORMAL + a] * reals[r + NORMAL + b]


@kernel
def distances(points, head, kind, out, normals):
    """Write the distances [m] of ``points`` (k, 3) [m] from the obstacle to ``out`` (k,), and the normals there."""
    for i in range(len(points)):
        found = distance_at(kind, head, points[i, 0], points[i, 1], points[i, 2])
        out[i], normals[i, 0], normals[i, 1], normals[i, 2] = found


@kernel
def nearness(x, quads, gauss, shape, head, kind, out):
    """Add to ``out`` (n,) [m^3] by how much nearer faces are than their corners tell, over the area about vertices.

    Faces across an edge of the obstacle, at whose corners its normals differ, are left out.
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
