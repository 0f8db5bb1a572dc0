# SPDX-License-Identifier: Apache-2.0
"""Compiled augmented Lagrangian of gaps and Coulomb friction between a round rigid body and a shape.

A ball touches the shape when its centre is one radius away. The normal force acts at the centre, and the gap is exact
for every rotation of the ball. The friction force acts at the material point that touched when the step began, c + R q
with q = -r R^T n. While the ball rolls by the angle theta in a step, that point slips by r theta^3 / 6 only. A capsule
is a row of such balls.

The arrays have the layout of `law`. The weights in a point's row are those of the centre (4,), then those of the
material point (4,). The offset is the radius.
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.solver.contact.coulomb import add_friction_tangent, envelope
from gdfe_ros.solver.contact.gap import (
    ANCHOR,
    COUNT,
    FRICTION,
    HEAD,
    KIND,
    NORMAL,
    OFFSET,
    ORIGIN,
    PENALTY,
    PRESS,
    SHEAR,
    STRIDE,
    VERTICES,
    WEIGHTS,
    gap_at,
    in_frame,
    point_at,
    take_frame,
    unit,
)
from gdfe_ros.solver.contact.law import push, push_back, shear_at
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

RUB = WEIGHTS + 4
"""Offset in a point's row of the weights (4,) of the material point on which friction acts."""


@inlined
def rub_at(x, reals, integers, i):
    """Return the position (3,) [m] of the material point that touches for point ``i``."""
    px, py, pz, weights, first = 0.0, 0.0, 0.0, HEAD + STRIDE * i + RUB, VERTICES + 4 * i
    for a in range(4):
        w, v = reals[weights + a], integers[first + a]
        px, py, pz = px + w * x[v, 0], py + w * x[v, 1], pz + w * x[v, 2]
    return px, py, pz


@inlined
def rub(reals, integers, i, f0, f1, f2, force):
    """Add the gradient f = dE/dp [N] of a material point, times its weights, to ``force`` (n, 3) at its carriers."""
    for a in range(4):
        w, v = reals[HEAD + STRIDE * i + RUB + a], integers[VERTICES + 4 * i + a]
        force[v, 0] += w * f0
        force[v, 1] += w * f1
        force[v, 2] += w * f2


@kernel
def round_energy(x, reals, integers, force, size):
    """Return the augmented Lagrangian [J] of all points; add its gradient to ``force``. See `term_kernel`."""
    energy, kind = 0.0, integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, held = reals[r + PENALTY], reals[r + PRESS]
        px, py, pz = point_at(x, reals, integers, i)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        press = max(0.0, held - k * (g - reals[r + OFFSET]))
        stored, given = press * press, held * held
        if press > 0.0:
            f0, f1, f2 = -press * nx, -press * ny, -press * nz
            push(reals, integers, i, f0, f1, f2, force)
            r0, r1, r2 = in_frame(reals, px - reals[ORIGIN], py - reals[ORIGIN + 1], pz - reals[ORIGIN + 2])
            push_back(reals, integers, f0, f1, f2, r0, r1, r2, force)
        limit = reals[FRICTION] * held
        if limit > 0.0:
            qx, qy, qz = rub_at(x, reals, integers, i)
            t0, t1, t2, trial = shear_at(reals, r, qx, qy, qz, limit)
            rub(reals, integers, i, t0, t1, t2, force)
            push_back(
                reals, integers, t0, t1, t2, reals[r + ANCHOR], reals[r + ANCHOR + 1], reals[r + ANCHOR + 2], force
            )
            stored += envelope(trial, limit)
            given += reals[r + SHEAR] ** 2 + reals[r + SHEAR + 1] ** 2 + reals[r + SHEAR + 2] ** 2
        energy += 0.5 * (stored - given) / k
        size[0] += 0.5 * (stored + given) / k
    return energy


@term_kernel
def round_entry(x, n, reals, k, integers, i, force, size):
    """Call `round_energy` with the raw pointers that the terms' kernels receive."""
    return round_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@kernel
def update_multipliers(x, reals, integers):
    """Update the multipliers and the normals; return the same four numbers as `law.update_multipliers`."""
    miss, kind, changed, held_now, stiff = 0.0, integers[KIND], 0.0, 0.0, 0.0
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, held = reals[r + PENALTY], reals[r + PRESS]
        px, py, pz = point_at(x, reals, integers, i)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        press = max(0.0, held - k * (g - reals[r + OFFSET]))
        nx, ny, nz = unit(nx, ny, nz)
        change = abs(press - held)
        qx, qy, qz = rub_at(x, reals, integers, i)
        t0, t1, t2, _ = shear_at(reals, r, qx, qy, qz, reals[FRICTION] * press)
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
        px, py, pz = point_at(x, reals, integers, i)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        limit = reals[FRICTION] * reals[r + PRESS]
        qx, qy, qz = rub_at(x, reals, integers, i)
        t0, t1, t2, trial = shear_at(reals, r, qx, qy, qz, limit)
        press = max(0.0, reals[r + PRESS] - reals[r + PENALTY] * (g - reals[r + OFFSET]))
        presses[i], slips[i] = press, trial >= limit
        shears[i, 0], shears[i, 1], shears[i, 2] = -t0, -t1, -t2
        forces[i, 0], forces[i, 1], forces[i, 2] = press * nx - t0, press * ny - t1, press * nz - t2


@kernel
def normal_tangents(x, reals, integers, out):
    """Write the normal tangent k n n^T [N/m] of each pressing point, with its penalty k, to ``out`` (p, 3, 3)."""
    kind = integers[KIND]
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        px, py, pz = point_at(x, reals, integers, i)
        g, nx, ny, nz = gap_at(kind, reals, r, px, py, pz)
        if reals[r + PRESS] - reals[r + PENALTY] * (g - reals[r + OFFSET]) > 0.0:
            normal = (nx, ny, nz)
            for a in range(3):
                for b in range(3):
                    out[i, a, b] = reals[r + PENALTY] * normal[a] * normal[b]


@kernel
def friction_tangents(x, reals, integers, out):
    """Write the positive semi-definite part (k, 3, 3) [N/m] of each material point's friction Hessian."""
    take_frame(x, reals, integers)
    for i in range(integers[COUNT]):
        r = HEAD + STRIDE * i
        k, limit = reals[r + PENALTY], reals[FRICTION] * reals[r + PRESS]
        if limit > 0.0:
            qx, qy, qz = rub_at(x, reals, integers, i)
            t0, t1, t2, trial = shear_at(reals, r, qx, qy, qz, limit)
            normal = (reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2])
            add_friction_tangent(k, limit, (t0, t1, t2), trial, normal, out[i])
