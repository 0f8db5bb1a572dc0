# SPDX-License-Identifier: Apache-2.0
"""Compiled evaluation of the potential and its gradient, and the line search along a direction or an arc."""

from __future__ import annotations

import math

from gdfe_ros.compiled import internal, kernel, merged
from gdfe_ros.solver.descent.lbfgs_workspace import inner
from gdfe_ros.solver.elements.response import evaluate, look
from gdfe_ros.solver.matrix.unknowns import add_rows, gather_in_threads, gather_rigid_rows, gather_rows, place
from gdfe_ros.solver.outcome import Outcome
from gdfe_ros.solver.terms.term import terms_energy

LARGE = 50_000
"""Least number of unknowns for which threads divide the sum of the elements' forces."""
ARMIJO = 1e-4
"""Fraction of the decrease predicted by the slope that a step must achieve: the usual value."""
MAX_CUTS = 30
"""The descent counts as stalled after this number of trial lengths of a step. Each is at most half of the last one, and
2^-30 is below any rounding.
"""
MOST_BLOCKED = 4
"""The body counts as running away if the energy at the full step is infinite in more than this number of successive
iterations.
"""
ENERGY_ROUNDING = 1e-13
"""Changes of the energy below this fraction of the sum of its terms are rounding errors in double precision."""


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
    """Search along the direction or the arc for a point with sufficiently lower energy; move the unknowns u there.

    The step is written to ``work.direction``. The condition is Armijo's, or its approximate form (Hager and Zhang 2005)
    if rounding of the energy exceeds its change. If no length satisfies the condition, or if ``first`` is set, u stays
    unchanged, and energy and gradient are evaluated at u.
    """
    status = work.status[0]
    slope, energy = status.slope, status.energy
    flat = status.grain + ENERGY_ROUNDING * (status.absolute + status.outside)
    length = 0.0 if first else 1.0
    for n in range(len(work.u)):
        work.old[n] = work.gradient[n]
    for cut in range(MAX_CUTS + 1):
        for n in range(len(work.u)):
            motion = length * (work.direction[n] + length * work.curve[n])
            work.trial[n] = work.u[n] + motion if length > 0.0 else work.u[n]
        # Translation and rotation of a handle add up at its vertices: they may move by twice the largest displacement.
        found = energy_and_gradient(work.trial, problem, work, 2.0 * length * status.step)
        if length == 0.0:
            status.energy = found
            status.ended = Outcome.NONE if first else Outcome.STALLED
            break
        if cut == 0:
            status.blocked = status.blocked + 1 if found == math.inf else 0
        if falls_enough(work, found, energy, length, flat):
            if energy - found > flat:
                status.plateau = 0
            status.energy = found
            break
        length = shorten(found, energy, length, slope)
        if cut == MAX_CUTS - 1 or status.blocked > MOST_BLOCKED:
            length = 0.0
    status.absolute, problem.watch.room[0] = absolute_sum(work.energies), problem.watch.room[1]
    for n in range(len(work.u)):
        work.u[n] = work.trial[n]
        work.direction[n] = length * (work.direction[n] + length * work.curve[n])
        work.curve[n] = 0.0


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
def shorten(found, energy, length, slope):
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
def advance(problem, work, first):
    """Search along the direction, or the arc; return whether no step lowers the energy enough.

    With ``first`` the terms are only evaluated at ``work.u``. One function does both, because each compiled copy takes
    seconds to compile.
    """
    search(problem, work, first)
    return work.status[0].ended != Outcome.NONE
