# SPDX-License-Identifier: Apache-2.0
"""L-BFGS with the constant global matrix as its initial Hessian (Liu, Bouaziz and Kavan 2017), compiled.

The inverse Hessian is kept in the compact form of Byrd, Nocedal and Schnabel (1994). With s the steps, y the changes
of the gradient g and v = A^-1 y, an iteration needs the products s_i . g and v_i . g, one pass over the history to
form the direction, and one solve z = A^-1 g, which is also the stopping measure.
"""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import internal, kernel, merged, vector_kernel
from gdfe_ros.solver.descent.stopping import LONGEST_WAY, note_step, way_left
from gdfe_ros.solver.descent.workspace import End
from gdfe_ros.solver.elements.response import evaluate
from gdfe_ros.solver.matrix.constant_matrix import apply_inverse
from gdfe_ros.solver.matrix.unknowns import add_rows, gather_rigid_rows, gather_rows, place
from gdfe_ros.solver.tangent.substitution import solve_kept
from gdfe_ros.solver.terms.term import terms_energy

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
def energy_and_gradient(u, problem, work):
    """Evaluate all terms at unknowns ``u``; return the energy and leave the gradient in ``work``."""
    place(u, problem.frame, problem.unknowns, work.x)
    total = evaluate(
        work.x,
        problem.shape,
        problem.blocks,
        problem.material,
        problem.pressure,
        problem.scale,
        problem.table,
        work.force,
        work.energies,
        problem.threads,
    )
    gather_rows(work.force, problem.unknowns, work.gradient)
    work.status[0].evaluations += 1
    pushed = len(problem.terms.address) > 0
    if pushed:
        total += terms_energy(work.x, problem.terms, work.outside, work.size)
        add_rows(work.outside, problem.unknowns, work.gradient)
        work.status[0].outside = work.size[0]
    gather_rigid_rows(u, work.x, work.force, work.outside, pushed, problem.frame, problem.unknowns, work.gradient)
    return total


@vector_kernel
def inner(a, b):
    """Return the inner product of two flat vectors."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@internal
def drop_oldest(work, count):
    """Shift the history so that its last slot is free."""
    oldest = work.row[0]
    for i in range(count - 1):
        work.row[i] = work.row[i + 1]
        for j in range(count - 1):
            work.triangle[i, j] = work.triangle[i + 1, j + 1]
            work.gram[i, j] = work.gram[i + 1, j + 1]
        work.products[0, i] = work.products[0, i + 1]
        work.products[1, i] = work.products[1, i + 1]
    work.row[count - 1] = oldest


@vector_kernel
def remember(work):
    """Add the pair of the last accepted step; skip it where the curvature is not positive.

    Its products with the older pairs come with the next direction, which needs their products with the gradient anyway.
    """
    status = work.status[0]
    count = status.count
    s, g, old, z, z_old = work.direction, work.gradient, work.old, work.step, work.trial
    curvature, norm, length, change = 0.0, 0.0, 0.0, 0.0
    for n in range(len(s)):
        y = g[n] - old[n]
        curvature += s[n] * y
        norm += (z[n] - z_old[n]) * y
        length += s[n] * s[n]
        change += y * y
    if not curvature > CURVATURE * np.sqrt(length * change):
        return
    if count == len(work.row):
        drop_oldest(work, count)
        count -= 1
    steps, images = work.steps[work.row[count]], work.images[work.row[count]]
    for n in range(len(s)):
        steps[n] = s[n]
        images[n] = z[n] - z_old[n]
    work.triangle[count, count] = curvature
    work.gram[count, count] = norm
    status.serial += 1
    work.serial[work.row[count]] = status.serial
    status.count = count + 1
    status.pending = 1


@kernel
def largest(step):
    """Return the largest vertex displacement [m] of a preconditioned step (3 r,)."""
    most = 0.0
    for i in range(0, len(step), 3):
        most = max(most, step[i] ** 2 + step[i + 1] ** 2 + step[i + 2] ** 2)
    return math.sqrt(most)


@kernel
def take_products(work):
    """Take the history's products with the gradient, and with them those of the newest pair with the older ones."""
    status = work.status[0]
    count, g = status.count, work.gradient
    p, w = work.products[0], work.products[1]
    new = count - 1 if status.pending == 1 else count
    for i in range(count):
        along, image = inner(work.steps[work.row[i]], g), inner(work.images[work.row[i]], g)
        if i < new < count:
            work.triangle[i, new] = along - p[i]
            work.gram[i, new] = work.gram[new, i] = image - w[i]
        p[i], w[i] = along, image
    status.pending = 0


@internal
def find_direction(work):
    """Write the quasi-Newton direction d = -H g and its slope g . d and size."""
    status = work.status[0]
    count = status.count
    take_products(work)
    g, z, d = work.gradient, work.step, work.direction
    p, w = work.products[0], work.products[1]
    scale = work.triangle[count - 1, count - 1] / work.gram[count - 1, count - 1] if count else 1.0
    lower, upper = work.products[2], work.products[3]
    for i in range(count - 1, -1, -1):
        lower[i] = p[i]
        for j in range(i + 1, count):
            lower[i] -= work.triangle[i, j] * lower[j]
        lower[i] /= work.triangle[i, i]
    for i in range(count):
        upper[i] = work.triangle[i, i] * lower[i] - scale * w[i]
        for j in range(count):
            upper[i] += scale * work.gram[i, j] * lower[j]
    for i in range(count):
        for j in range(i):
            upper[i] -= work.triangle[j, i] * upper[j]
        upper[i] /= work.triangle[i, i]
    for n in range(len(d)):
        d[n] = -scale * z[n]
    for i in range(count):
        a, b = upper[i], scale * lower[i]
        s, v = work.steps[work.row[i]], work.images[work.row[i]]
        for n in range(len(d)):
            d[n] += b * v[n] - a * s[n]
    status.slope = inner(d, g)
    far, plain = largest(d), largest(z)
    if count and not (status.slope < 0.0 and far > MOST_SHORTENED * plain):
        status.count = 0
        find_direction(work)
    else:
        status.distance = far


@merged
def search(problem, work, first):
    """Move along the quasi-Newton direction until the energy falls enough; leave the step in ``direction``.

    Armijo's condition, or its approximate form (Hager and Zhang 2005) where the energy no longer resolves the step.
    Where no length is short enough, or with ``first``, the energy and its gradient are left as they are at ``u``.
    """
    status = work.status[0]
    slope, energy = status.slope, status.energy
    flat = status.grain + ROUNDING * (status.absolute + status.outside)
    length = 0.0 if first else 1.0
    for n in range(len(work.u)):
        work.old[n] = work.gradient[n]
    for cut in range(MAX_CUTS + 1):
        for n in range(len(work.u)):
            work.trial[n] = work.u[n] + length * work.direction[n] if length > 0.0 else work.u[n]
        found = energy_and_gradient(work.trial, problem, work)
        if length == 0.0:
            status.energy = found
            status.ended = End.NONE if first else End.STALLED
            break
        if cut == 0:
            status.blocked = status.blocked + 1 if found == math.inf else 0
        enough = found <= energy + ARMIJO * length * slope
        if not enough and found <= energy + flat:
            enough = inner(work.gradient, work.direction) <= (2.0 * ARMIJO - 1.0) * slope
        if enough:
            if energy - found > flat:
                status.plateau = 0
            status.energy = found
            break
        curvature = found - energy - length * slope
        shorter = -0.5 * slope * length * length / curvature if math.isfinite(curvature) else 0.1 * length
        length = min(max(shorter, 0.1 * length), 0.5 * length)
        if cut == MAX_CUTS - 1 or status.blocked > MOST_BLOCKED:
            length = 0.0
    status.absolute = absolute_sum(work.energies)
    for n in range(len(work.u)):
        work.u[n] = work.trial[n]
        work.direction[n] *= length
        work.trial[n] = work.step[n]


@internal
def absolute_sum(values):
    """Return the sum of absolute values."""
    total = 0.0
    for i in range(len(values)):
        total += abs(values[i])
    return total


@kernel
def advance(problem, work, target, first):
    """Do one iteration from a fresh preconditioned gradient; tell whether none was needed or none is possible.

    The quasi-Newton step estimates the distance to the equilibrium; the minimisation ends when its largest vertex
    displacement is at most ``target`` [m]. With ``first`` the elements are evaluated at ``work.u`` and nothing
    moves; the history of earlier minimisations stays. One function does both: each copy takes seconds to compile.
    """
    status = work.status[0]
    if first:
        status.blocked = 0
        status.plateau = 0
        status.nearest = math.inf
    else:
        if status.given == 1:
            status.given = 0
        else:
            find_direction(work)
        note_step(work)
        if status.distance <= target and way_left(work) <= LONGEST_WAY * target:
            return True
        if not status.distance <= status.reach:
            status.ended = End.RUNAWAY
            status.count = 0
            return True
        status.plateau += 1
        if status.distance < 0.5 * status.nearest:
            status.nearest = status.distance
            status.plateau = 0
        elif status.plateau > MOST_FLAT:
            status.ended = End.EXHAUSTED
            status.count = 0
            return True
    search(problem, work, first)
    return status.ended != End.NONE


@kernel
def descend(problem, work, coupling, floor, least, target, limit, evaluate):
    """Iterate with the explicit inverse until the quasi-Newton step is at most ``target`` [m]; return iterations.

    Before ``least`` of them it is the ``floor`` [m]. The terms at the start are evaluated where they have yet to be.
    """
    if evaluate:
        advance(problem, work, target, evaluate)
    apply_inverse(work.gradient, coupling, work.step)
    first = limit < 0  # not the literal: numba would compile a copy of `advance` for it, and the two round differently
    for iteration in range(limit):
        if advance(problem, work, floor if iteration < least else target, first):
            return iteration
        apply_inverse(work.gradient, coupling, work.step)
        remember(work)
    return limit


@kernel
def descend_kept(problem, work, kept, target, limit):
    """The same with a kept tangent; ``work.step`` holds the first preconditioned gradient."""
    for iteration in range(limit):
        if advance(problem, work, target, limit < 0):
            return iteration
        solve_kept(kept, work.gradient, work.step)
        remember(work)
    return limit
