# SPDX-License-Identifier: Apache-2.0
"""L-BFGS with the constant global matrix as its initial Hessian (Liu, Bouaziz and Kavan 2017), compiled.

The inverse Hessian is kept in the compact form of Byrd, Nocedal and Schnabel (1994). With s the steps, y the changes
of the gradient g and v = A^-1 y, an iteration needs the products s_i . g and v_i . g, one pass over the history to
form the direction, and one solve z = A^-1 g, which is also the stopping measure.
"""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.actuators.external import external_energy
from gdfe_ros.compiled import internal, kernel, merged, vector_kernel
from gdfe_ros.solver.descent import (
    ABSOLUTE,
    BLOCKED,
    COUNT,
    DISTANCE,
    ENERGY,
    EVALUATIONS,
    EXHAUSTED,
    FLAT,
    GRAIN,
    NEAREST,
    OUTSIDE,
    PENDING,
    REACH,
    RUNAWAY,
    SLOPE,
    STALLED,
)
from gdfe_ros.solver.global_matrix import apply_inverse
from gdfe_ros.solver.response import evaluate
from gdfe_ros.solver.stopping import LONGEST_WAY, note_step, way_left
from gdfe_ros.solver.unknowns import add_rows, gather_rows, place

ARMIJO = 1e-4
MAX_CUTS = 30
MOST_BLOCKED = 4
"""Full steps in a row into infinite energy after which the body counts as running away."""
ROUNDING = 1e-13
CURVATURE = 1e-10
MOST_SHORTENED = 1e-4
"""Factor by which the history may shorten the plain preconditioned step. The last pairs of a very exact solve are made
of rounding; were they believed, a body whose command has changed would seem to be at rest."""

MOST_FLAT = 60
"""Iterations in which neither the energy falls by more than its rounding nor the step halves: no more is to be had."""


@merged
def energy_and_gradient(u, problem, external, descent):
    """Evaluate all elements at unknowns ``u``; return the energy and leave the gradient in ``descent``."""
    place(u, problem.base, problem.unknowns, descent.x)
    total = evaluate(
        descent.x,
        problem.shape,
        problem.blocks,
        problem.material,
        problem.pressure,
        problem.share,
        problem.table,
        descent.force,
        descent.energies,
        problem.threads,
    )
    gather_rows(descent.force, problem.unknowns, descent.gradient)
    descent.status[EVALUATIONS] += 1
    if external is not None:
        energy, size = external_energy(descent.x, external, descent.outside)
        add_rows(descent.outside, problem.unknowns, descent.gradient)
        descent.status[OUTSIDE] = size
        total += energy
    return total


@vector_kernel
def inner(a, b):
    """Return the inner product of two flat vectors."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@internal
def drop_oldest(descent, count):
    """Shift the history so that its last slot is free."""
    oldest = descent.row[0]
    for i in range(count - 1):
        descent.row[i] = descent.row[i + 1]
        for j in range(count - 1):
            descent.triangle[i, j] = descent.triangle[i + 1, j + 1]
            descent.gram[i, j] = descent.gram[i + 1, j + 1]
        descent.products[0, i] = descent.products[0, i + 1]
        descent.products[1, i] = descent.products[1, i + 1]
    descent.row[count - 1] = oldest


@vector_kernel
def remember(descent):
    """Add the pair of the last accepted step; skip it where the curvature is not positive.

    Its products with the older pairs come with the next direction, which needs their products with the gradient anyway.
    """
    count = int(descent.status[COUNT])
    s, g, old, z, z_old = descent.direction, descent.gradient, descent.old, descent.step, descent.trial
    curvature, norm, length, change = 0.0, 0.0, 0.0, 0.0
    for n in range(len(s)):
        y = g[n] - old[n]
        curvature += s[n] * y
        norm += (z[n] - z_old[n]) * y
        length += s[n] * s[n]
        change += y * y
    if not curvature > CURVATURE * np.sqrt(length * change):
        return
    if count == len(descent.row):
        drop_oldest(descent, count)
        count -= 1
    steps, images = descent.steps[descent.row[count]], descent.images[descent.row[count]]
    for n in range(len(s)):
        steps[n] = s[n]
        images[n] = z[n] - z_old[n]
    descent.triangle[count, count] = curvature
    descent.gram[count, count] = norm
    descent.status[COUNT] = count + 1
    descent.status[PENDING] = 1


@kernel
def largest(step):
    """Return the largest vertex displacement [m] of a preconditioned step (3 r,)."""
    most = 0.0
    for i in range(0, len(step), 3):
        most = max(most, step[i] ** 2 + step[i + 1] ** 2 + step[i + 2] ** 2)
    return math.sqrt(most)


@internal
def find_direction(descent):
    """Write the quasi-Newton direction d = -H g and its slope g . d and size."""
    count = int(descent.status[COUNT])
    g, z, d = descent.gradient, descent.step, descent.direction
    p, w = descent.products[0], descent.products[1]
    new = count - 1 if descent.status[PENDING] == 1 else count
    for i in range(count):
        along, image = inner(descent.steps[descent.row[i]], g), inner(descent.images[descent.row[i]], g)
        if i < new < count:
            descent.triangle[i, new] = along - p[i]
            descent.gram[i, new] = descent.gram[new, i] = image - w[i]
        p[i], w[i] = along, image
    descent.status[PENDING] = 0
    scale = descent.triangle[count - 1, count - 1] / descent.gram[count - 1, count - 1] if count else 1.0
    lower, upper = descent.products[2], descent.products[3]
    for i in range(count - 1, -1, -1):
        lower[i] = p[i]
        for j in range(i + 1, count):
            lower[i] -= descent.triangle[i, j] * lower[j]
        lower[i] /= descent.triangle[i, i]
    for i in range(count):
        upper[i] = descent.triangle[i, i] * lower[i] - scale * w[i]
        for j in range(count):
            upper[i] += scale * descent.gram[i, j] * lower[j]
    for i in range(count):
        for j in range(i):
            upper[i] -= descent.triangle[j, i] * upper[j]
        upper[i] /= descent.triangle[i, i]
    for n in range(len(d)):
        d[n] = -scale * z[n]
    for i in range(count):
        a, b = upper[i], scale * lower[i]
        s, v = descent.steps[descent.row[i]], descent.images[descent.row[i]]
        for n in range(len(d)):
            d[n] += b * v[n] - a * s[n]
    descent.status[SLOPE] = inner(d, g)
    far, plain = largest(d), largest(z)
    if count and not (descent.status[SLOPE] < 0.0 and far > MOST_SHORTENED * plain):
        descent.status[COUNT] = 0
        find_direction(descent)
    else:
        descent.status[DISTANCE] = far


@merged
def search(problem, external, descent, first):
    """Move along the quasi-Newton direction until the energy falls enough; leave the step in ``direction``.

    Armijo's condition, or its approximate form (Hager and Zhang 2005) where the energy no longer resolves the step.
    Where no length is short enough, or with ``first``, the energy and its gradient are left as they are at ``u``.
    """
    slope, energy = descent.status[SLOPE], descent.status[ENERGY]
    flat = descent.status[GRAIN] + ROUNDING * (descent.status[ABSOLUTE] + descent.status[OUTSIDE])
    length = 0.0 if first else 1.0
    for n in range(len(descent.u)):
        descent.old[n] = descent.gradient[n]
    for cut in range(MAX_CUTS + 1):
        for n in range(len(descent.u)):
            descent.trial[n] = descent.u[n] + length * descent.direction[n] if length > 0.0 else descent.u[n]
        found = energy_and_gradient(descent.trial, problem, external, descent)
        if length == 0.0:
            descent.status[ENERGY] = found
            descent.status[STALLED] = 0 if first else 1
            break
        if cut == 0:
            descent.status[BLOCKED] = descent.status[BLOCKED] + 1 if found == math.inf else 0
        enough = found <= energy + ARMIJO * length * slope
        if not enough and found <= energy + flat:
            enough = inner(descent.gradient, descent.direction) <= (2.0 * ARMIJO - 1.0) * slope
        if enough:
            if energy - found > flat:
                descent.status[FLAT] = 0
            descent.status[ENERGY] = found
            break
        curvature = found - energy - length * slope
        shorter = -0.5 * slope * length * length / curvature if math.isfinite(curvature) else 0.1 * length
        length = min(max(shorter, 0.1 * length), 0.5 * length)
        if cut == MAX_CUTS - 1 or descent.status[BLOCKED] > MOST_BLOCKED:
            length = 0.0
    descent.status[ABSOLUTE] = absolute_sum(descent.energies)
    for n in range(len(descent.u)):
        descent.u[n] = descent.trial[n]
        descent.direction[n] *= length
        descent.trial[n] = descent.step[n]


@internal
def absolute_sum(values):
    """Return the sum of absolute values."""
    total = 0.0
    for i in range(len(values)):
        total += abs(values[i])
    return total


@kernel
def advance(problem, external, descent, target, first):
    """Do one iteration from a fresh preconditioned gradient; tell whether none was needed or none is possible.

    The quasi-Newton step estimates the distance to the equilibrium; the minimisation ends when its largest vertex
    displacement is at most ``target`` [m]. With ``first`` the elements are evaluated at ``descent.u`` and nothing
    moves; the history of earlier minimisations stays. One function does both: each copy takes seconds to compile.
    """
    if first:
        descent.status[BLOCKED] = 0
        descent.status[FLAT] = 0
        descent.status[NEAREST] = math.inf
        if descent.status[PENDING] == 1:
            descent.status[PENDING] = 0
            descent.status[COUNT] -= 1
    else:
        find_direction(descent)
        note_step(descent)
        if descent.status[DISTANCE] <= target and way_left(descent) <= LONGEST_WAY * target:
            return True
        if not descent.status[DISTANCE] <= descent.status[REACH]:
            descent.status[STALLED] = RUNAWAY
            descent.status[COUNT] = 0
            return True
        descent.status[FLAT] += 1
        if descent.status[DISTANCE] < 0.5 * descent.status[NEAREST]:
            descent.status[NEAREST] = descent.status[DISTANCE]
            descent.status[FLAT] = 0
        elif descent.status[FLAT] > MOST_FLAT:
            descent.status[STALLED] = EXHAUSTED
            descent.status[COUNT] = 0
            return True
    search(problem, external, descent, first)
    return descent.status[STALLED] > 0


@kernel
def descend(problem, external, descent, coupling, target, limit):
    """Iterate with the explicit inverse until the quasi-Newton step is at most ``target`` [m]; return iterations."""
    apply_inverse(descent.gradient, coupling, descent.step)
    # Not the literal: numba would compile a copy of `advance` for it, or use the one that there is, and the two round
    # differently. What a solve gives must not depend on which was compiled first.
    first = limit < 0
    for iteration in range(limit):
        if advance(problem, external, descent, target, first):
            return iteration
        apply_inverse(descent.gradient, coupling, descent.step)
        remember(descent)
    return limit
