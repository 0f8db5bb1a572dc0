# SPDX-License-Identifier: Apache-2.0
"""Compiled contact forces of pairs: a vertex and a face, or two edges, of the same body.

The law is that of `gdfe_ros.solver.contact.held_forces`: while a step is made, the forces of each pair are held, and
`complementarity` finds them before the step. The pair of a vertex x and its face has a plane with the normal n through
the face point y = sum w_a x_a. The gap is g = n . (x - y). The slip s is the component of x - y - o in the plane, where
the offset o is x - y of the same material points in the last state. During a step, gap and slip
are linear in the positions and invariant to translation, so that the forces on vertex and face cancel to rounding.
Planes and face points are found anew before each step.

A face carries a vertex at its rim with the fraction c only: c is 1 above the face, and 0 at the outer edge of the rim.
The force acts through a spring of stiffness k c / (1 - c), with k the stiffness of the body at the pair: the gap closes
up to the spring's length. A vertex that slides over an edge is thus released gradually, and no equilibrium is skipped.
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.solver.contact.held_forces import ROUNDING, put_tangents, shortened
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

FRICTION, HEAD = 0, 1
"""Layout of the term's reals: offsets of the friction coefficient and of the first pair's row."""
SCALE, PRESS, NORMAL, WEIGHTS, SHEAR, OFFSET, SUPPORT, STRIDE = 0, 1, 2, 5, 9, 12, 15, 16
"""Layout of a pair's row: offsets of the stiffness k [N/m], normal force l [N], normal n (3,), weights w (4,), friction
force t (3,) [N], offset o (3,) [m] and support c. `STRIDE` is the row's length.
"""
COUNT, BODY, CARRIERS, CARRIED, VERTICES = 0, 1, 2, 3, 4
"""Layout of the term's integers: offsets of the number of pairs, of the number n of vertices, of two offsets, and of
the first pair's points. A point below n is a vertex. Other points are points of skins: each has eight carriers in the
integers from the offset at `CARRIERS` on, with eight weights in the reals from the offset at `CARRIED` on.
"""
VERTEX, FACE, WIDTH = 0, 1, 5
"""Layout of a pair's points: offsets of the vertex, and of its face's corners (4,). `WIDTH` is their number."""


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
def away(x, reals, integers, r, i):
    """Return the vector (3,) [m] from the face point of a pair to its vertex."""
    d0, d1, d2 = place_of(x, reals, integers, integers[i + VERTEX])
    for a in range(4):
        w = reals[r + WEIGHTS + a]
        p0, p1, p2 = place_of(x, reals, integers, integers[i + FACE + a])
        d0, d1, d2 = d0 - w * p0, d1 - w * p1, d2 - w * p2
    return d0, d1, d2


@inlined
def push(reals, integers, r, i, f0, f1, f2, force):
    """Add the gradient f = dE/d(away) [N] to ``force`` (n, 3) [N], at the vertex and, negated, at the face corners."""
    pull(reals, integers, integers[i + VERTEX], f0, f1, f2, force)
    for a in range(4):
        w = reals[r + WEIGHTS + a]
        pull(reals, integers, integers[i + FACE + a], -w * f0, -w * f1, -w * f2, force)


@inlined
def gap_of(x, reals, integers, r, i):
    """Return the gap [m] of a pair."""
    d0, d1, d2 = away(x, reals, integers, r, i)
    return reals[r + NORMAL] * d0 + reals[r + NORMAL + 1] * d1 + reals[r + NORMAL + 2] * d2


@inlined
def slip_of(x, reals, integers, r, i):
    """Return the slip (3,) [m] of a pair, in its plane."""
    d0, d1, d2 = away(x, reals, integers, r, i)
    d0, d1, d2 = d0 - reals[r + OFFSET], d1 - reals[r + OFFSET + 1], d2 - reals[r + OFFSET + 2]
    n0, n1, n2 = reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2]
    along = n0 * d0 + n1 * d1 + n2 * d2
    return d0 - along * n0, d1 - along * n1, d2 - along * n2


@kernel
def pair_energy(x, reals, integers, force, size):
    """Return the work -l g + t . s [J] of the held forces; add its gradient to ``force``. See `term_kernel`."""
    energy = 0.0
    for pair in range(integers[COUNT]):
        r, i = HEAD + STRIDE * pair, VERTICES + WIDTH * pair
        press, t0, t1, t2 = reals[r + PRESS], reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2]
        if press == 0.0:
            continue
        n0, n1, n2 = reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2]
        f0, f1, f2 = t0 - press * n0, t1 - press * n1, t2 - press * n2
        push(reals, integers, r, i, f0, f1, f2, force)
        work = -press * gap_of(x, reals, integers, r, i)
        energy += work
        size[0] += abs(work)
        if t0 != 0.0 or t1 != 0.0 or t2 != 0.0:
            s0, s1, s2 = slip_of(x, reals, integers, r, i)
            work = t0 * s0 + t1 * s1 + t2 * s2
            energy += work
            size[0] += abs(work)
    return energy


@term_kernel
def pair_entry(x, n, reals, k, integers, i, force, size):
    """Call `pair_energy` with the raw pointers that the terms' kernels receive."""
    return pair_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@kernel
def pair_forces(x, reals, integers, presses, shears, slips, slid):
    """Write each pair's normal force, friction force on the face [N], whether it slips, and its slip [m]."""
    for pair in range(integers[COUNT]):
        r, i = HEAD + STRIDE * pair, VERTICES + WIDTH * pair
        t0, t1, t2 = reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2]
        limit = reals[FRICTION] * reals[r + PRESS]
        presses[pair] = reals[r + PRESS]
        slips[pair] = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2) >= (1.0 - ROUNDING) * limit
        shears[pair, 0], shears[pair, 1], shears[pair, 2] = t0, t1, t2
        slid[pair, 0], slid[pair, 1], slid[pair, 2] = slip_of(x, reals, integers, r, i)


@kernel
def project_pairs(x, reals, integers):
    """Replace the forces of pairs by those of the projections of `complementarity`; see `project_forces`."""
    for pair in range(integers[COUNT]):
        r, i = HEAD + STRIDE * pair, VERTICES + WIDTH * pair
        k, held = reals[r + SCALE], reals[r + PRESS]
        press = reals[r + SUPPORT] * max(0.0, held - k * gap_of(x, reals, integers, r, i))
        s0, s1, s2 = slip_of(x, reals, integers, r, i)
        t0, t1, t2 = reals[r + SHEAR] + k * s0, reals[r + SHEAR + 1] + k * s1, reals[r + SHEAR + 2] + k * s2
        t0, t1, t2 = shortened(t0, t1, t2, reals[FRICTION] * press)
        reals[r + PRESS] = press
        reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2] = t0, t1, t2


@kernel
def pair_stencils(x, reals, integers, places, axes, held, soft, ends, pressing, rubbing):
    """Write the stencils of pairs. ``soft`` (k,) [m/N] is the compliance of the spring at a rim; 0 above a face."""
    share = ends.shape[1] // WIDTH
    for pair in range(integers[COUNT]):
        r, i = HEAD + STRIDE * pair, VERTICES + WIDTH * pair
        normal = reals[r + NORMAL], reals[r + NORMAL + 1], reals[r + NORMAL + 2]
        axes[pair, 0, 0], axes[pair, 0, 1], axes[pair, 0, 2] = normal
        soft[pair] = (1.0 - reals[r + SUPPORT]) / (reals[r + SUPPORT] * reals[r + SCALE])
        places[pair, 0], held[pair, 0] = gap_of(x, reals, integers, r, i), reals[r + PRESS]
        t = reals[r + SHEAR], reals[r + SHEAR + 1], reals[r + SHEAR + 2]
        put_tangents(pair, normal, slip_of(x, reals, integers, r, i), t, places, axes, held)
        for a in range(WIDTH):
            q, weight = integers[i + a], 1.0 if a == VERTEX else -reals[r + WEIGHTS + a - FACE]
            for c in range(share):
                v, w = q, 1.0 if c == 0 else 0.0
                if q >= integers[BODY]:
                    v = integers[integers[CARRIERS] + 8 * (q - integers[BODY]) + c]
                    w = reals[integers[CARRIED] + 8 * (q - integers[BODY]) + c]
                ends[pair, share * a + c], pressing[pair, share * a + c] = v, w * weight
                rubbing[pair, share * a + c] = w * weight
