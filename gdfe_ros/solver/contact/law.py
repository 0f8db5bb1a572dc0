# SPDX-License-Identifier: Apache-2.0
"""The augmented Lagrangian of gaps and of Coulomb friction at the vertices of a surface, compiled.

With the gap g, a multiplier l >= 0 and a penalty k, contact has the potential (max(0, l - k g)^2 - l^2) / 2 k, whose
minimum with all else and l <- max(0, l - k g) in turn reach g >= 0, l >= 0, l g = 0 (Rockafellar 1973). Friction has
the Moreau envelope of mu l |s|: with the slip s in the plane of contact since the anchor and the multiplier t, the
trial t + k s is shortened to mu l, and t <- that. A vertex that sticks keeps its anchor: nothing creeps.

The gap of a vertex is its distance from the obstacle, less its ``offset``: by how much nearer the faces about it are on
average than distances interpolated from their corners would tell. About a ball, where faces are chords, that halves
the error of gaps that are taken at vertices alone; a vertex itself never comes nearer than that.
"""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.solver.contact.distance import signed_distance
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

AXES, ORIGIN, NUMBERS, FRICTION, HEAD = 0, 9, 12, 15, 16
"""Where rotation, origin [m], the form's numbers and the coefficient lie, and where the vertices begin."""
PENALTY, PRESS, SHEAR, ANCHOR, NORMAL, OFFSET, STRIDE = 0, 1, 2, 5, 8, 11, 12
"""Of each vertex: k [N/m], l [N], t [N] (3,), anchor [m] (3,), normal (3,), offset [m]."""
KIND, COUNT, VERTICES = 0, 1, 2
"""Where the form's kind, the number of vertices and these lie."""


@inlined
def distance_at(kind, head, px, py, pz):
    """Return the distance [m] of a point from the obstacle, and the normal there, in world axes."""
    dx, dy, dz = px - head[ORIGIN], py - head[ORIGIN + 1], pz - head[ORIGIN + 2]
    g, n0, n1, n2 = signed_distance(
        kind,
        head[NUMBERS],
        head[NUMBERS + 1],
        head[NUMBERS + 2],
        head[0] * dx + head[3] * dy + head[6] * dz,
        head[1] * dx + head[4] * dy + head[7] * dz,
        head[2] * dx + head[5] * dy + head[8] * dz,
    )
    nx = head[0] * n0 + head[1] * n1 + head[2] * n2
    ny = head[3] * n0 + head[4] * n1 + head[5] * n2
    nz = head[6] * n0 + head[7] * n1 + head[8] * n2
    return g, nx, ny, nz


@inlined
def shear_at(reals, r, px, py, pz, limit):
    """Return the shear [N] that friction up to ``limit`` [N] holds at a vertex, and the length of its trial."""
    k, n0, n1, n2 = reals[r + PENALTY], reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2]
    dx, dy, dz = px - reals[r + ANCHOR], py - reals[r + ANCHOR + 1], pz - reals[r + ANCHOR + 2]
    along = n0 * dx + n1 * dy + n2 * dz
    t0 = reals[r + SHEAR] + k * (dx - along * n0)
    t1 = reals[r + SHEAR + 1] + k * (dy - along * n1)
    t2 = reals[r + SHEAR + 2] + k * (dz - along * n2)
    trial = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    share = limit / trial if trial > limit else 1.0
    return share * t0, share * t1, share * t2, trial


@kernel
def contact_energy(x, reals, integers, force, size):
    """Return the energy [J] of all vertices; `term_kernel` wants this signature."""
    energy, kind = 0.0, integers[KIND]
    for i in range(integers[COUNT]):
        r, v = HEAD + STRIDE * i, integers[VERTICES + i]
        k, held = reals[r + PENALTY], reals[r + PRESS]
        g, nx, ny, nz = distance_at(kind, reals, x[v, 0], x[v, 1], x[v, 2])
        press = max(0.0, held - k * (g - reals[r + OFFSET]))
        stored, given = press * press, held * held
        force[v, 0] -= press * nx
        force[v, 1] -= press * ny
        force[v, 2] -= press * nz
        limit = reals[FRICTION] * held
        if limit > 0.0:
            t0, t1, t2, trial = shear_at(reals, r, x[v, 0], x[v, 1], x[v, 2], limit)
            force[v, 0] += t0
            force[v, 1] += t1
            force[v, 2] += t2
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
        By how far [m] a vertex missed its gap or slipped against its multiplier, at most; the forces [N] that were
        changed, and those that there are now; the penalties [N/m] where there are.
    """
    miss, kind, changed, held_now, stiff = 0.0, integers[KIND], 0.0, 0.0, 0.0
    for i in range(integers[COUNT]):
        r, v = HEAD + STRIDE * i, integers[VERTICES + i]
        k, held = reals[r + PENALTY], reals[r + PRESS]
        g, nx, ny, nz = distance_at(kind, reals, x[v, 0], x[v, 1], x[v, 2])
        press = max(0.0, held - k * (g - reals[r + OFFSET]))
        change = abs(press - held)
        t0, t1, t2, _ = shear_at(reals, r, x[v, 0], x[v, 1], x[v, 2], reals[FRICTION] * press)
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
    """Write of each vertex the force on the body, what of it presses, its shear [N], and whether it slips."""
    kind = integers[KIND]
    for i in range(integers[COUNT]):
        r, v = HEAD + STRIDE * i, integers[VERTICES + i]
        g, nx, ny, nz = distance_at(kind, reals, x[v, 0], x[v, 1], x[v, 2])
        held = reals[r + PRESS]
        limit = reals[FRICTION] * held
        t0, t1, t2, trial = shear_at(reals, r, x[v, 0], x[v, 1], x[v, 2], limit)
        press = max(0.0, held - reals[r + PENALTY] * (g - reals[r + OFFSET]))
        presses[i], slips[i] = press, trial >= limit
        shears[i, 0], shears[i, 1], shears[i, 2] = -t0, -t1, -t2
        forces[i, 0], forces[i, 1], forces[i, 2] = press * nx - t0, press * ny - t1, press * nz - t2


@kernel
def contact_tangents(x, reals, integers, out):
    """Write what of the second derivative [N/m] is nowhere negative, (k, 3, 3)."""
    kind = integers[KIND]
    for i in range(integers[COUNT]):
        r, v = HEAD + STRIDE * i, integers[VERTICES + i]
        k, held = reals[r + PENALTY], reals[r + PRESS]
        g, nx, ny, nz = distance_at(kind, reals, x[v, 0], x[v, 1], x[v, 2])
        if held - k * (g - reals[r + OFFSET]) > 0.0:
            normal = (nx, ny, nz)
            for a in range(3):
                for b in range(3):
                    out[i, a, b] = k * normal[a] * normal[b]
        limit = reals[FRICTION] * held
        if limit > 0.0:
            _, _, _, trial = shear_at(reals, r, x[v, 0], x[v, 1], x[v, 2], limit)
            share = k * limit / trial if trial > limit else k
            for a in range(3):
                out[i, a, a] += share
                for b in range(3):
                    out[i, a, b] -= share * reals[r + NORMAL + a] * reals[r + NORMAL + b]


@kernel
def distances(x, vertices, head, kind, out, normals):
    """Write the distance [m] of each of ``vertices`` (k,) from the obstacle to ``out`` (k,), and the normal there."""
    for i in range(len(vertices)):
        v = vertices[i]
        out[i], normals[i, 0], normals[i, 1], normals[i, 2] = distance_at(kind, head, x[v, 0], x[v, 1], x[v, 2])


@kernel
def nearness(x, quads, gauss, shape, head, kind, out):
    """Add to ``out`` (n,) [m^3] by how much nearer faces are than their corners tell, over the area about vertices."""
    corner = np.empty(4)
    for q in range(len(quads)):
        for a in range(4):
            v = quads[q, a]
            corner[a] = distance_at(kind, head, x[v, 0], x[v, 1], x[v, 2])[0]
        for p in range(4):
            px, py, pz, told = 0.0, 0.0, 0.0, 0.0
            for a in range(4):
                w, v = shape[p, a], quads[q, a]
                px, py, pz, told = px + w * x[v, 0], py + w * x[v, 1], pz + w * x[v, 2], told + w * corner[a]
            nearer = gauss[q, p] * (told - distance_at(kind, head, px, py, pz)[0])
            for a in range(4):
                out[quads[q, a]] += shape[p, a] * nearer
