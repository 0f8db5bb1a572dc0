# SPDX-License-Identifier: Apache-2.0
"""Compiled augmented Lagrangian of gaps and friction between vertices and faces of the same body.

The law is that of `gdfe_ros.solver.contact.law`. During a minimisation, the pair of a vertex x and its face has a plane
with the normal n through the face point sum w_a x_a. The gap is g = n . (x - sum w_a x_a). Friction ties x to the point
y = sum v_b x_b of the face on which it stuck last. The offset o is the value of x - y at that time. The slip s is the
component of x - y - o in the plane. Gap and slip are linear in the positions and invariant to translation, so that the
forces on vertex and face cancel to rounding.

A face carries a vertex at its rim with the fraction c only: c is 1 above the face, and 0 at the outer edge of the rim.
The normal force is c max(0, l - k g). In the limit of the updates this is a spring of stiffness k c / (1 - c) between
vertex and face. A vertex that slides over an edge is thus released gradually, and no equilibrium is skipped.
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.solver.contact.coulomb import envelope, shortened
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

FRICTION, HEAD = 0, 1
"""Layout of the term's reals: offsets of the friction coefficient and of the first pair's row."""
PENALTY, PRESS, NORMAL, WEIGHTS, SHEAR, HOLD, OFFSET, SUPPORT, STRIDE = 0, 1, 2, 5, 9, 12, 16, 19, 20
"""Layout of a pair's row: offsets of the penalty k [N/m], normal force l [N], normal n (3,), weights w (4,), friction
force t (3,) [N], weights v (4,), offset o (3,) [m] and support c. `STRIDE` is the row's length.
"""
COUNT, BODY, CARRIERS, CARRIED, VERTICES = 0, 1, 2, 3, 4
"""Layout of the term's integers: offsets of the number of pairs, of the number n of vertices, of two offsets, and of
the first pair's points. A point below n is a vertex. Other points are points of skins: each has eight carriers in the
integers from the offset at `CARRIERS` on, with eight weights in the reals from the offset at `CARRIED` on.
"""
VERTEX, FACE, HELD, WIDTH = 0, 1, 5, 9
"""Layout of a pair's points: offsets of the vertex, of its face's corners (4,), and of the corners (4,) of the face to
which friction ties the vertex. `WIDTH` is the number of integers of a pair.
"""


@inlined
def place_of(x, reals, integers, q):
    """Return the position (3,) [m] of a point."""
    p0, p1, p2 = 0.0, 0.0, 0.0
    if q < integers[BODY]:
        p0, p1, p2 = x[q, 0], x[q, 1], x[q, 2]
    else:
        i, r = integers[CARRIERS] + 8 * (q - integers[BODY]), integers[CARRIED] + 8 * (q - integers[BODY])
        for a in range(8):
            w, v = reals[r + a], integers[i + a]
            p0, p1, p2 = p0 + w * x[v, 0], p1 + w * x[v, 1], p2 + w * x[v, 2]
    return p0, p1, p2


@inlined
def pull(reals, integers, q, f0, f1, f2, force):
    """Add the gradient f [N] of a point to ``force`` (n, 3) [N], at its vertex or at its carriers."""
    if q < integers[BODY]:
        force[q, 0] += f0
        force[q, 1] += f1
        force[q, 2] += f2
    else:
        i, r = integers[CARRIERS] + 8 * (q - integers[BODY]), integers[CARRIED] + 8 * (q - integers[BODY])
        for a in range(8):
            w, v = reals[r + a], integers[i + a]
            force[v, 0] += w * f0
            force[v, 1] += w * f1
            force[v, 2] += w * f2


@inlined
def away(x, reals, integers, weights, vertex, corners):
    """Return the vector (3,) [m] from a face point with four corner weights to a vertex."""
    d0, d1, d2 = place_of(x, reals, integers, integers[vertex])
    for a in range(4):
        w = reals[weights + a]
        p0, p1, p2 = place_of(x, reals, integers, integers[corners + a])
        d0, d1, d2 = d0 - w * p0, d1 - w * p1, d2 - w * p2
    return d0, d1, d2


@inlined
def push(reals, integers, weights, vertex, corners, f0, f1, f2, force):
    """Add the gradient f = dE/d(away) [N] to ``force`` (n, 3) [N], at the vertex and, negated, at the face corners."""
    pull(reals, integers, integers[vertex], f0, f1, f2, force)
    for a in range(4):
        w = reals[weights + a]
        pull(reals, integers, integers[corners + a], -w * f0, -w * f1, -w * f2, force)


@inlined
def gap_of(x, reals, integers, r, i):
    """Return the gap [m] of a pair."""
    d0, d1, d2 = away(x, reals, integers, r + WEIGHTS, i + VERTEX, i + FACE)
    return reals[r + NORMAL] * d0 + reals[r + NORMAL + 1] * d1 + reals[r + NORMAL + 2] * d2


@inlined
def slip_of(x, reals, integers, r, i):
    """Return the slip (3,) [m] of a pair, in its plane."""
    d0, d1, d2 = away(x, reals, integers, r + HOLD, i + VERTEX, i + HELD)
    d0, d1, d2 = d0 - reals[r + OFFSET], d1 - reals[r + OFFSET + 1], d2 - reals[r + OFFSET + 2]
    n0, n1, n2 = reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2]
    along = n0 * d0 + n1 * d1 + n2 * d2
    return d0 - along * n0, d1 - along * n1, d2 - along * n2


@inlined
def shear_of(x, reals, integers, r, i, limit):
    """Return the friction force (3,) [N] of a pair, shortened to ``limit`` [N], and the trial force's length [N]."""
    k = reals[r + PENALTY]
    s0, s1, s2 = slip_of(x, reals, integers, r, i)
    t0, t1, t2 = reals[r + SHEAR] + k * s0, reals[r + SHEAR + 1] + k * s1, reals[r + SHEAR + 2] + k * s2
    return shortened(t0, t1, t2, limit)


@kernel
def pair_energy(x, reals, integers, force, size):
    """Return the augmented Lagrangian [J] of all pairs; add its gradient to ``force``. See `term_kernel`."""
    energy = 0.0
    for pair in range(integers[COUNT]):
        r, i = HEAD + STRIDE * pair, VERTICES + WIDTH * pair
        k, held = reals[r + PENALTY], reals[r + PRESS]
        trial = max(0.0, held - k * gap_of(x, reals, integers, r, i))
        press = reals[r + SUPPORT] * trial
        stored, given = press * trial, held * held
        if press > 0.0:
            n0, n1, n2 = reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2]
            push(reals, integers, r + WEIGHTS, i + VERTEX, i + FACE, -press * n0, -press * n1, -press * n2, force)
        limit = reals[FRICTION] * held
        if limit > 0.0:
            t0, t1, t2, trial = shear_of(x, reals, integers, r, i, limit)
            push(reals, integers, r + HOLD, i + VERTEX, i + HELD, t0, t1, t2, force)
            stored += envelope(trial, limit)
            given += reals[r + SHEAR] ** 2 + reals[r + SHEAR + 1] ** 2 + reals[r + SHEAR + 2] ** 2
        energy += 0.5 * (stored - given) / k
        size[0] += 0.5 * (stored + given) / k
    return energy


@term_kernel
def pair_entry(x, n, reals, k, integers, i, force, size):
    """Call `pair_energy` with the raw pointers that the terms' kernels receive."""
    return pair_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@kernel
def pair_forces(x, reals, integers, gaps, presses, shears, slips, slid):
    """Write each pair's gap [m], normal force, friction force on the face [N], whether it slips, and its slip [m]."""
    for pair in range(integers[COUNT]):
        r, i = HEAD + STRIDE * pair, VERTICES + WIDTH * pair
        gaps[pair] = gap_of(x, reals, integers, r, i)
        presses[pair] = reals[r + SUPPORT] * max(0.0, reals[r + PRESS] - reals[r + PENALTY] * gaps[pair])
        limit = reals[FRICTION] * reals[r + PRESS]
        t0, t1, t2, trial = shear_of(x, reals, integers, r, i, limit)
        slips[pair] = trial >= limit
        shears[pair, 0], shears[pair, 1], shears[pair, 2] = t0, t1, t2
        slid[pair, 0], slid[pair, 1], slid[pair, 2] = slip_of(x, reals, integers, r, i)


@kernel
def update_pairs(x, reals, integers):
    """Update the multipliers l and t.

    Returns:
        Four numbers: the largest error [m] in gap or slip of a pair, |change of force| / k; the sum of the changes of
        forces [N]; the sum of the normal forces [N]; the sum of the penalties [N/m] of the pairs that press.
    """
    miss, changed, held_now, stiff = 0.0, 0.0, 0.0, 0.0
    for pair in range(integers[COUNT]):
        r, i = HEAD + STRIDE * pair, VERTICES + WIDTH * pair
        k, held = reals[r + PENALTY], reals[r + PRESS]
        press = reals[r + SUPPORT] * max(0.0, held - k * gap_of(x, reals, integers, r, i))
        change = abs(press - held)
        t0, t1, t2, _ = shear_of(x, reals, integers, r, i, reals[FRICTION] * press)
        if reals[FRICTION] > 0.0:
            d0, d1, d2 = t0 - reals[r + SHEAR], t1 - reals[r + SHEAR + 1], t2 - reals[r + SHEAR + 2]
            change = max(change, math.sqrt(d0 * d0 + d1 * d1 + d2 * d2))
        miss, changed = max(miss, change / k), changed + change
        if press > 0.0:
            held_now, stiff = held_now + press, stiff + k
        reals[r + PRESS] = press
        reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2] = t0, t1, t2
    return miss, changed, held_now, stiff
