# SPDX-License-Identifier: Apache-2.0
"""The compiled minimisation with contact: each quasi-Newton step includes forces that satisfy the laws of contact.

Let g be the gradient of the potential, H the approximate inverse of its Hessian, and J the derivative of gaps and
slips. While the contact forces f are constant, the step is d = -H g. If they change by df, the step is
d = -H (g - J^T df), and the gaps and slips at its end are p = p0 + J d. The change df is chosen so that f + df and p
satisfy the laws (see `complementarity`).
"""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.mesh.triples import corner, dot
from gdfe_ros.solver.contact.complementarity import HALF, row_product, solve_laws
from gdfe_ros.solver.contact.compliance import add_inertia, find_compliance, turn_direction
from gdfe_ros.solver.contact.contact_term import MARGIN
from gdfe_ros.solver.contact.field import differentiate, project
from gdfe_ros.solver.contact.stencil import add_load, find_stencils, turn_shear
from gdfe_ros.solver.descent.lbfgs_workspace import inner
from gdfe_ros.solver.descent.loop import ENDLESS, MOST_FLAT, WILD, choose, move, start
from gdfe_ros.solver.matrix.unknowns import add_rows, gather_rigid_rows
from gdfe_ros.solver.outcome import Outcome

START, BEGIN, SEARCH, ANSWER, MOVE = range(5)
"""Stages: evaluate all terms, once in a minimisation. In each iteration: find the step at constant contact forces; let
the caller search for parts of the body that may meet in this step; find the new forces; make the step.
"""
ROUNDS = 8
"""Largest number of attempts at the forces of a step. Another attempt follows if points entered, which then join, or if
a large violation has halved. The next step takes over what remains.
"""
EXACT, ROUGH = 1e-6, 1e-3
"""In a step as long as the target of the minimisation, the laws may be violated by the first number times the target.
In longer steps, the allowed violation grows with the square of the step's length, up to the second number times this
length. The errors of the first steps of a minimisation are larger than that anyway.
"""
MOST_CHANGES = 30
"""Contact does not settle if either of two counts of iterations exceeds this. The first counts iterations in which
pressing points touch other faces; it restarts when the length of the step falls to half of its least value. The second
counts iterations in which the laws are violated; it restarts when the violation falls to half of its least value.
"""
REVERSED, MOST_INERTIA, FADING = 0.7, 64.0, 0.7
"""A step reverses the last one if the cosine between both is below minus the first number. The inertia, a number, then
doubles, from at least 1 to at most the second number. In every other step, it is multiplied by the third number. The
inertia times the body's compliance at a point is added to the point's compliance, and only the fraction
1 / (1 + inertia) of the step is made. Without inertia, the notched finger of a test closes 0.7 mm beside its plane.
"""
LEAST_SLOPE = 0.1
"""A point is left out of a step if the gradient of its distance is shorter than this: in the middle of an obstacle."""

TALLY = np.dtype(
    [
        ("stage", np.int64),  # the next one
        ("over", np.int64),  # whether the minimisation has ended
        ("shows", np.int64),  # whether the caller shows each step
        ("swings", np.int64),  # whether steps may swing, see `shorten`
        ("found", np.int64),  # result of `choose` for the present step
        ("count", np.int64),  # number of points that take part in it
        ("rounds", np.int64),  # number of times that its forces were found
        ("exact", np.int64),  # whether the newest pair of L-BFGS contains the whole change of the gradient
        ("changed", np.int64),  # whether points that press touch other faces than in the last step
        ("changes", np.int64),  # number of iterations in which they do
        ("in_vain", np.int64),  # number of iterations in which the laws are violated
        ("idle", np.float64),  # number of iterations since a step was half as long as the shortest before
        ("nearest", np.float64),  # length of this shortest step [m]
        ("left", np.float64),  # largest violation of the laws in the last step [m]
        ("least", np.float64),  # least violation so far [m]
        ("allowed", np.float64),  # allowed violation [m]
        ("faint", np.float64),  # negligible violation [m]
        ("inertia", np.float64),  # of forces and steps
        ("gone", np.float64),  # bound of the motion of any vertex since points were chosen [m]
        ("room", np.float64),  # motion after which points are chosen again [m]
        ("spare", np.float64),  # motion after which the caller has to search parts of the body that press nowhere [m]
    ]
)
"""Fields of the progress of a minimisation with contact."""


@internal
def holds(held, i):
    """Return whether point ``i`` has a force."""
    return held[i, 0] != 0.0 or held[i, 1] != 0.0 or held[i, 2] != 0.0


@internal
def gap_ahead(field, i):
    """Return the gap [m] of point ``i`` at the end of the step, plus the compression of the point's spring."""
    s = field.stencils
    return s.places[i, 0] + s.soft[i] * s.held[i, 0] + field.ahead[i, 0]


@internal
def exchange_loads(problem, work, field):
    """Set the dead loads of the contacts to the present contact forces; add the difference to energy and gradient."""
    loads, change, unknowns, x = field.loads, field.change, problem.unknowns, work.x
    for v in range(len(loads) if field.acting[0] == 1 else 0):
        for j in range(3):
            work.status[0].energy -= loads[v, j] * (x[v, j] - loads[v, 3 + j])
            change[v, j] = -loads[v, j]
            loads[v, j] = 0.0
    field.acting[0] = 0
    for i in range(len(field.owner)):
        if holds(field.stencils.held, i):
            field.acting[0] = 1
            add_load(field.stencils, i, loads)
    for v in range(len(loads)):
        for j in range(3):
            change[v, j] += loads[v, j]
            loads[v, 3 + j] = x[v, j]
            work.outside[v, j] += change[v, j]
    add_rows(change, unknowns, work.gradient)
    gather_rigid_rows(work.u, work.x, work.force, work.outside, True, problem.frame, unknowns, work.gradient)
    change[:] = 0.0


@internal
def curve(work, field):
    """Correct the newest pair of L-BFGS for the contact forces that turned in the last step.

    A force turns where its point moves along a curved surface. The pairs thus contain the curvature of the surfaces.

    Return whether there is such a pair, and it was corrected.
    """
    status, before = work.status[0], field.before
    newest, fresh = (status.head - 1) % len(work.curvature), status.head != field.head[0]
    field.head[0] = status.head
    if status.count == 0 or not fresh:
        return False
    curvature, s, y = work.curvature[newest], work.steps[newest], work.changes[newest]
    for n in range(len(before)):
        curvature += s[n] * (work.gradient[n] - before[n])
    if curvature > 0.0:
        work.curvature[newest] = curvature
        for n in range(len(before)):
            y[n] += work.gradient[n] - before[n]
    return curvature > 0.0


@internal
def begin_step(problem, work, metric, field, rows, tally, size, most):
    """Begin an iteration: turn the forces with the surfaces, find the step and its points, and set the next stage."""
    for n in range(len(field.before)):
        field.before[n] = work.gradient[n]
    find_stencils(work.x, field.surfaces, field.faces, field.owner, field.stencils)
    exchange_loads(problem, work, field)
    t = tally[0]
    t.exact = curve(work, field)
    t.found = choose(problem, work, metric, size, most)
    t.count, t.left, t.rounds = find_joins(problem, work, field, rows, size), 0.0, 0
    may_meet = t.found != 0 and not t.gone + 2.0 * work.status[0].step < t.spare
    t.stage = SEARCH if may_meet else ANSWER


@kernel
def look_again(problem, work, field, rows, size):
    """Find the stencils of points that were gathered anew; return the number of points that take part in the step."""
    find_stencils(work.x, field.surfaces, field.faces, field.owner, field.stencils)
    return find_joins(problem, work, field, rows, size)


@internal
def find_joins(problem, work, field, rows, size):
    """Find the points that take part in the step; return their number.

    ``rows`` is a pair: the row of each free vertex, and the number of each vertex' handle (see `differentiate`).
    """
    s, count = field.stencils, 0
    given = *rows, s.axes, s.ends, s.pressing, s.rubbing, field.rows, field.blocks, field.used
    differentiate(work.x, work.u, problem.frame, problem.unknowns, *given)
    project(work.direction, field.rows, field.blocks, field.used, field.ahead)
    for i in range(len(field.owner)):
        steepest = max(abs(s.axes[i, 0, 0]), abs(s.axes[i, 0, 1]), abs(s.axes[i, 0, 2]))
        field.usable[i] = steepest > LEAST_SLOPE and field.used[i] > 0
        field.joins[i] = field.usable[i] and (gap_ahead(field, i) < MARGIN * size or holds(s.held, i))
        if field.joins[i]:
            field.chosen[count] = i
            count += 1
    return count


@internal
def linearise(field, chosen, w, q, start):
    """Write the gaps and slips ``q`` (3 c,) [m] of the ``chosen`` points without forces, and their present forces."""
    s = field.stencils
    for a in range(len(chosen)):
        i = chosen[a]
        for k in range(3):
            q[3 * a + k], start[3 * a + k] = s.places[i, k] + field.ahead[i, k], s.held[i, k]
        q[3 * a] += s.soft[i] * s.held[i, 0]
    for n in range(len(q)):
        q[n] -= row_product(w, start, n)


@internal
def hold(field, chosen, now):
    """Set the forces of ``chosen`` points to ``now`` (3 c,) [N]; unusable ones lose theirs. Return if any changed."""
    held, shears, changed = field.stencils.held, field.stencils.shears, False
    for i in range(len(held)):
        if not field.usable[i] and holds(held, i):
            held[i, 0], held[i, 1], held[i, 2], changed = 0.0, 0.0, 0.0, True
            shears[i, 0], shears[i, 1], shears[i, 2] = 0.0, 0.0, 0.0
    for a in range(len(chosen)):
        i = chosen[a]
        for k in range(3):
            changed |= held[i, k] != now[3 * a + k]
            held[i, k] = now[3 * a + k]
        turn_shear(i, field.stencils)
    return changed


@internal
def settle(problem, work, metric, field, known, count, size, target, allowed, faint):
    """Find the forces of the points that take part, and the step with them.

    The first c = ``count`` points of ``field.chosen`` take part. ``known`` has their compliance, and receives their
    displacements and forces. Other points that enter by more than ``target`` [m] join. ``allowed`` and ``faint`` [m]
    are the tolerances of `solve_laws`.

    Return the largest violation of the laws [m], the result of `choose`, whether forces changed, and the number of
    points that join.
    """
    chosen, left, found, entered = field.chosen[:count], 0.0, 2, 0
    if count:
        linearise(field, chosen, known.w, known.q, known.forces)
        left = solve_laws(known.w, known.q, field.friction[chosen], known.forces, allowed, faint)
    changed = hold(field, chosen, known.forces)
    if changed:
        found = follow_forces(problem, work, metric, field, known, count, size)
        project(work.direction, field.rows, field.blocks, field.used, field.ahead)
        for i in range(len(field.owner)):
            if field.usable[i] and not field.joins[i] and gap_ahead(field, i) < -target:
                field.joins[i] = True
                entered += 1
    return left, found, changed, entered


@internal
def follow_forces(problem, work, metric, field, known, count, size):
    """Exchange the dead loads, and write the step with the new ones; return the result of `choose`."""
    status, change = work.status[0], field.before
    for n in range(len(change)):
        change[n] = work.gradient[n]
    exchange_loads(problem, work, field)
    for n in range(len(change)):
        change[n] = work.gradient[n] - change[n]
    if count and status.wild == 0 and turn_direction(work, metric, known, change) and status.step <= WILD * size:
        return 2
    return choose(problem, work, metric, size, ENDLESS)


@internal
def allow(target, step):
    """Return the allowed violation [m] of the laws in a ``step`` [m], see `EXACT`."""
    ratio = max(1.0, step / target)
    return target * ratio * min(EXACT * ratio, ROUGH)


@internal
def find_forces(problem, work, metric, field, known, tally, size, target):
    """Find the forces with which the step satisfies the laws, and write that step.

    Return False if `Compliance.prepare` must be called first.
    """
    t, status, before, ready = tally[0], work.status[0], np.inf, -1
    t.allowed = allow(target, min(status.before, status.step))
    while t.rounds < ROUNDS:
        if t.count and ready != t.count + (len(field.owner) + 1) * status.wild:
            if not find_compliance(work, metric, field, known, t.count, t.exact and t.rounds == 0):
                return False
            ready = t.count + (len(field.owner) + 1) * status.wild
            if t.inertia > 0.0:
                add_inertia(field, known, t.count, t.inertia)
        given = known, t.count, size, target, t.allowed, t.faint
        t.rounds += 1
        t.left, chose, changed, entered = settle(problem, work, metric, field, *given)
        if not changed:
            break
        t.found, rough = chose, t.left > max(t.faint, ROUGH * max(target, status.step))
        if not ((rough and t.left < HALF * before) or entered):
            break
        before, t.allowed = t.left, allow(target, status.step)
        if entered:
            t.count = 0
            for i in range(len(field.owner)):
                if field.joins[i]:
                    field.chosen[t.count] = i
                    t.count += 1
    return True


@internal
def shorten(work, field, tally):
    """Shorten the step if it reverses the last one, or if points move farther than their stencils are valid.

    Faces that touch are found anew before each step. Forces may then change sides and directions from step to step. The
    inertia therefore doubles in a step that reverses the last one; otherwise it decreases (see `REVERSED`). The
    distance to the equilibrium is still estimated from the whole step.
    """
    t, step, last = tally[0], work.direction, field.last
    if inner(last, step) < -REVERSED * math.sqrt(inner(last, last) * inner(step, step)):
        t.inertia = min(max(1.0, 2.0 * t.inertia), MOST_INERTIA)
    else:
        t.inertia *= FADING
    last[:] = step
    share = 1.0 / (1.0 + t.inertia)
    for i in range(len(field.owner)):
        moved = corner(field.ahead, i)
        share = min(share, field.valid[i] / max(math.sqrt(dot(moved, moved)), 1e-300))
    for n in range(len(step)):
        step[n] *= share
    work.status[0].slope *= share


@internal
def evaluate_first(problem, work, tally):
    """Evaluate all terms if the minimisation starts."""
    if tally[0].stage == START:
        start(problem, work)
        tally[0].stage = BEGIN


@internal
def end_answer(work, field, known, tally, touching):
    """Store the direction for `find_newest`, and shorten the step if forces change from step to step."""
    known.last_direction[:] = work.direction
    known.pairs[1], known.pairs[2] = work.status[0].head, work.status[0].count if tally[0].count else -1
    if touching and tally[0].swings:
        shorten(work, field, tally)


@kernel
def is_settling(tally):
    """Return whether the touching points and their forces have settled, or may still settle."""
    t = tally[0]
    return max(t.changes, t.in_vain) <= MOST_CHANGES and t.idle <= MOST_FLAT


@internal
def go_on(work, tally, trust):
    """Count the iterations in which contact does not settle; return whether it may still settle.

    An iteration whose step is not half as long as the shortest one counts as ``trust``, the assumed least ratio of a
    step to the distance to the equilibrium.
    """
    t, status = tally[0], work.status[0]
    rough = max(ROUGH * status.step, t.faint)
    if t.left <= max(HALF * t.least, rough):
        t.least, t.in_vain = t.left, 0
    if t.left > rough:
        t.in_vain += 1
    if status.nearest != t.nearest:
        t.nearest, t.changes, t.idle = status.nearest, 0, 0.0
    t.idle += trust
    t.changes += t.changed
    return is_settling(tally)


@kernel
def descend_touching(problem, work, metric, field, known, tally, rows, size, target, proven, most, limit):
    """Do `descend` with contact, from the stage in ``tally`` on; return the number of iterations.

    It returns early where the caller has to act: before points may have to be chosen again, at the stage `SEARCH`,
    before forces whose compliance `Compliance.prepare` must provide first, and before a step that the caller shows.

    The arguments are those of `descend` and four more: the near points ``field``, the part of their compliance that is
    ``known``, the progress ``tally`` (1,) with the fields of `TALLY`, and the ``rows`` of `find_joins`.
    """
    t, made = tally[0], 0
    evaluate_first(problem, work, tally)
    while made < limit:
        if t.stage == BEGIN:
            if t.gone > 0.0 and not t.gone < t.room:
                return made
            begin_step(problem, work, metric, field, rows, tally, size, most)
            if t.stage == SEARCH:
                return made
        if t.stage == ANSWER:
            touching = t.found != 0 and len(field.owner) > 0
            if touching and not find_forces(problem, work, metric, field, known, tally, size, target):
                return made
            end_answer(work, field, known, tally, touching)
            t.stage = MOVE
            if t.shows:
                return made
        t.stage = BEGIN
        if t.found == 0 or not move(problem, work, metric, size, target, proven, t.found == 2):
            t.over = 1
            return made
        t.gone += 2.0 * work.status[0].step  # translation and rotation of a handle add up at its vertices
        made += 1
        if not go_on(work, tally, metric.trust):
            work.status[0].ended, t.over = Outcome.GIVEN_UP, 1
            return made
    return made
