# SPDX-License-Identifier: Apache-2.0
"""Compiled parts of a quasi-Newton step with contact; `contact_forces` calls them in turn."""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.solver.contact.complementarity import row_product, solve_laws
from gdfe_ros.solver.contact.compliance import differentiate, project
from gdfe_ros.solver.contact.contact_term import MARGIN
from gdfe_ros.solver.contact.stencil import add_load, find_stencils, turn_shear
from gdfe_ros.solver.descent.loop import ENDLESS, choose
from gdfe_ros.solver.matrix.unknowns import add_rows, gather_rigid_rows

LEAST_SLOPE = 0.1
"""A point takes no part where the gradient of its distance is shorter than this: in the middle of an obstacle."""


@internal
def holds(held, i):
    """Return whether point ``i`` holds a force."""
    return held[i, 0] != 0.0 or held[i, 1] != 0.0 or held[i, 2] != 0.0


@internal
def gap_ahead(field, i):
    """Return the gap [m] of point ``i`` at the end of the step, with the length of its spring."""
    s = field.stencils
    return s.places[i, 0] + s.soft[i] * s.held[i, 0] + field.ahead[i, 0]


@internal
def exchange_loads(problem, work, field):
    """Replace the loads of the contacts by those of the present forces; correct energy and gradient for them."""
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
    """Add to the newest pair the change of the gradient by forces that turned in the last step.

    The pairs thus contain the curvature of the surfaces: forces turn where a point moves along them.
    """
    status, before = work.status[0], field.before
    newest, fresh = (status.head - 1) % len(work.curvature), status.head != field.head[0]
    field.head[0] = status.head
    if status.count == 0 or not fresh:
        return
    curvature, s, y = work.curvature[newest], work.steps[newest], work.changes[newest]
    for n in range(len(before)):
        curvature += s[n] * (work.gradient[n] - before[n])
    if curvature > 0.0:
        work.curvature[newest] = curvature
        for n in range(len(before)):
            y[n] += work.gradient[n] - before[n]


@kernel
def begin_step(problem, work, metric, field, row_of, handle_of, size, most):
    """Turn the forces of all points with the surfaces, find the step with them, and the points that take part.

    Return the result of `choose`, and the number of points.
    """
    for n in range(len(field.before)):
        field.before[n] = work.gradient[n]
    find_stencils(work.x, field.surfaces, field.owner, field.stencils)
    exchange_loads(problem, work, field)
    curve(work, field)
    found = choose(problem, work, metric, size, most)
    return found, find_joins(problem, work, field, row_of, handle_of, size)


@kernel
def look_again(problem, work, field, row_of, handle_of, size):
    """Find the stencils of points that were gathered anew, and those that take part; return their number."""
    find_stencils(work.x, field.surfaces, field.owner, field.stencils)
    return find_joins(problem, work, field, row_of, handle_of, size)


@internal
def find_joins(problem, work, field, row_of, handle_of, size):
    """Find the points that take part in the step; return their number."""
    s, count = field.stencils, 0
    given = row_of, handle_of, s.axes, s.ends, s.pressing, s.rubbing, field.rows, field.blocks, field.used
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
    """Write the displacements ``q`` (3 c,) [m] of the ``chosen`` points without forces, and their present forces."""
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
    """Set the forces ``now`` (3 c,) [N] of the ``chosen`` points; those that are not usable lose theirs.

    Return whether any force has changed.
    """
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


@kernel
def settle(problem, work, metric, field, count, w, size, target, allowed, faint):
    """Find the forces of the points that take part, and the step with them.

    The first c = ``count`` of ``field.chosen`` take part; ``w`` (3 c, 3 c) [m/N] is their compliance. Others that enter
    by more than ``target`` [m] join. ``allowed`` and ``faint`` [m] are those of `solve_laws`.

    Return the largest violation of the laws [m], the result of `choose`, whether forces changed, the number of points
    that join, and the problem's displacements without forces (3 c,) [m] and forces (3 c,) [N].
    """
    chosen, q, now = field.chosen[:count], np.empty(3 * count), np.empty(3 * count)
    left, found, entered = 0.0, 2, 0
    if count:
        linearise(field, chosen, w, q, now)
        left = solve_laws(w, q, field.friction[chosen], now, allowed, faint)
    changed = hold(field, chosen, now)
    if changed:
        exchange_loads(problem, work, field)
        found = choose(problem, work, metric, size, ENDLESS)
        project(work.direction, field.rows, field.blocks, field.used, field.ahead)
        for i in range(len(field.owner)):
            if field.usable[i] and not field.joins[i] and gap_ahead(field, i) < -target:
                field.joins[i] = True
                entered += 1
    return left, found, changed, entered, q, now
