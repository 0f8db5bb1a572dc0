# SPDX-License-Identifier: Apache-2.0
"""Compiled L-BFGS with the constant global matrix as its initial Hessian (Liu, Bouaziz and Kavan 2017).

The inverse Hessian is kept in the compact form of Byrd, Nocedal and Schnabel (1994). Let s be the steps, y the changes
of the gradient g, and v = A^-1 y. An iteration needs the products s_i . g and v_i . g, one pass over the history to
form the direction, and one solve z = A^-1 g. The largest displacement of the direction also decides when to stop.
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import internal, kernel, merged
from gdfe_ros.solver.descent.pairs import LARGE, find_direction, inner, remember
from gdfe_ros.solver.descent.stopping import LONGEST_WAY, note_step, way_left
from gdfe_ros.solver.descent.workspace import End
from gdfe_ros.solver.elements.response import evaluate
from gdfe_ros.solver.elements.watch import look
from gdfe_ros.solver.matrix.constant_matrix import apply_inverse
from gdfe_ros.solver.matrix.unknowns import add_rows, gather_in_threads, gather_rigid_rows, gather_rows, place
from gdfe_ros.solver.tangent.substitution import solve_kept
from gdfe_ros.solver.terms.term import terms_energy

ARMIJO = 1e-4
"""Fraction of the decrease predicted by the slope that a step must achieve: the usual value."""
MAX_CUTS = 30
"""The descent counts as stalled after this number of trial lengths of a step. Each is at most half of the last one, and
2^-30 is below any rounding.
"""
MOST_BLOCKED = 4
"""The body counts as running away after more than this number of successive iterations whose full step has infinite
energy.
"""
ROUNDING = 1e-13
"""Changes of the energy below this fraction of the sum of its terms are rounding errors in double precision."""
SHIFT_AND_TURN = 2.0
"""A vertex may move by this multiple of the largest displacement in a step: translation and rotation of a handle add up
at its vertices.
"""
MOST_FLAT = 60
"""The minimisation ends after this number of iterations without progress: the energy fell by no more than rounding, and
the length of the step did not fall to half of its least value.
"""


@merged
def energy_and_gradient(u, problem, work, moved):
    """Evaluate all terms at unknowns ``u``; return the energy [J] and write the gradient to ``work``.

    The caller guarantees that no vertex is more than ``moved`` [m] away from the last accepted positions.
    """
    place(u, problem.frame, problem.unknowns, work.x)
    watch = problem.watch
    if moved > watch.room[0]:
        watch.room[1] = look(work.x, problem.shape, problem.blocks, watch)
    else:
        watch.room[1] = watch.room[0] - moved
    total = evaluate(
        work.x,
        problem.shape,
        problem.blocks,
        problem.material,
        problem.pressure,
        problem.scale,
        problem.table,
        watch.elements[: watch.count[0]],
        work.force,
        work.energies,
        problem.threads,
    )
    gather(work, problem.unknowns, problem.threads)
    work.status[0].evaluations += 1
    pushed = len(problem.terms.address) > 0
    if pushed:
        total += terms_energy(work.x, problem.terms, work.outside, work.size)
        add_rows(work.outside, problem.unknowns, work.gradient)
        work.status[0].outside = work.size[0]
    gather_rigid_rows(u, work.x, work.force, work.outside, pushed, problem.frame, problem.unknowns, work.gradient)
    return total


@internal
def gather(work, unknowns, threads):
    """Write the gradient's rows of free vertices from the elements' forces."""
    if threads is None or len(work.gradient) < LARGE:
        gather_rows(work.force, unknowns, work.gradient)
    else:
        gather_in_threads(threads, work.force, unknowns, work.gradient)


@merged
def search(problem, work, first):
    """Search along the direction, or the arc, until the energy falls enough, and move ``u`` there.

    The step is written to ``direction``. The condition is Armijo's, or its approximate form (Hager and Zhang 2005) if
    the energy cannot resolve the step. If no length satisfies the condition, or if ``first`` is set, ``u`` stays
    unchanged. Energy and gradient are then evaluated at ``u``.
    """
    status = work.status[0]
    slope, energy = status.slope, status.energy
    flat = status.grain + ROUNDING * (status.absolute + status.outside)
    length = 0.0 if first else 1.0
    for n in range(len(work.u)):
        work.old[n] = work.gradient[n]
    for cut in range(MAX_CUTS + 1):
        for n in range(len(work.u)):
            motion = length * (work.direction[n] + length * work.curve[n])
            work.trial[n] = work.u[n] + motion if length > 0.0 else work.u[n]
        found = energy_and_gradient(work.trial, problem, work, SHIFT_AND_TURN * length * status.distance)
        if length == 0.0:
            status.energy = found
            status.ended = End.NONE if first else End.STALLED
            break
        if cut == 0:
            status.blocked = status.blocked + 1 if found == math.inf else 0
        if falls_enough(work, found, energy, length, flat):
            if energy - found > flat:
                status.plateau = 0
            status.energy = found
            break
        length = shortened(found, energy, length, slope)
        if cut == MAX_CUTS - 1 or status.blocked > MOST_BLOCKED:
            length = 0.0
    status.absolute, problem.watch.room[0] = absolute_sum(work.energies), problem.watch.room[1]
    status.length = length
    for n in range(len(work.u)):
        work.u[n] = work.trial[n]
        work.direction[n] = length * (work.direction[n] + length * work.curve[n])
        work.trial[n], work.curve[n] = work.step[n], 0.0


@internal
def falls_enough(work, found, energy, length, flat):
    """Return whether the energy ``found`` [J] at a trial length satisfies Armijo's condition or its approximate form.

    ``energy`` [J] is the one before the step; differences up to ``flat`` [J] are rounding.
    """
    slope = work.status[0].slope
    enough = found <= energy + ARMIJO * length * slope
    if not enough and found <= energy + flat:
        enough = inner(work.gradient, work.direction) <= (2.0 * ARMIJO - 1.0) * slope
    return enough


@internal
def shortened(found, energy, length, slope):
    """Return the next trial length: the minimum of a parabola, between a tenth and half of the last length."""
    curvature = found - energy - length * slope
    shorter = -0.5 * slope * length * length / curvature if math.isfinite(curvature) else 0.1 * length
    return min(max(shorter, 0.1 * length), 0.5 * length)


@internal
def absolute_sum(values):
    """Return the sum of absolute values."""
    total = 0.0
    for i in range(len(values)):
        total += abs(values[i])
    return total


@kernel
def advance(problem, work, target, first):
    """Make one iteration; return whether the minimisation has ended, at its target or because it cannot continue.

    ``work.step`` must contain the preconditioned gradient. The quasi-Newton step estimates the distance to the
    equilibrium. The minimisation ends when the largest vertex displacement of this step is at most ``target`` [m], and
    the result of `way_left` is at most `LONGEST_WAY` times the target. With ``first`` the terms are only evaluated at
    ``work.u``: nothing moves, and the history stays. One function does both, because each compiled copy takes seconds
    to compile.
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
            find_direction(work, problem.threads)
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
    """Make iterations with the constant matrix until the step is at most ``target`` [m]; return their number.

    At most ``limit`` iterations are made. In the first ``least`` iterations, ``floor`` [m] replaces the target. With
    ``evaluate``, the terms are first evaluated at the start.
    """
    if evaluate:
        advance(problem, work, target, evaluate)
    apply_inverse(work.gradient, coupling, work.step, problem.threads)
    first = limit < 0  # not a literal: numba would compile another copy of `advance` for it, which rounds differently
    for iteration in range(limit):
        if advance(problem, work, floor if iteration < least else target, first):
            return iteration
        apply_inverse(work.gradient, coupling, work.step, problem.threads)
        remember(work)
    return limit


@kernel
def descend_kept(problem, work, kept, target, limit):
    """Iterate as `descend`, but with a kept tangent; ``work.step`` must contain the first preconditioned gradient."""
    for iteration in range(limit):
        if advance(problem, work, target, limit < 0):
            return iteration
        solve_kept(kept, work.gradient, work.step)
        remember(work)
    return limit
