# SPDX-License-Identifier: Apache-2.0
"""The compiled minimisation: L-BFGS around a tangent that turns with the body.

The initial matrix is M = R K0 R^T: K0 is the tangent stiffness at earlier positions (at first of the undeformed body),
and R the rotation of each vertex since then. Near an equilibrium, M differs from the present tangent K by strains
alone. The eigenvalues of M^-1 K then lie near 1, the steps shrink by half or more in each iteration, and the length of
the step measures the distance to the equilibrium: if successive steps shrink by the ratio r, the sum of all further
steps is |d| / (1 - r).

For a body whose tangent is too expensive, M is the constant matrix A.
"""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.solver.descent.arc import follow_arc
from gdfe_ros.solver.descent.lbfgs_workspace import begin_recursion, end_recursion, inner, remember
from gdfe_ros.solver.descent.search import advance
from gdfe_ros.solver.matrix.constant_matrix import Coupling, apply_inverse
from gdfe_ros.solver.matrix.rotation import vertex_rotations
from gdfe_ros.solver.matrix.substitution import Kept, solve_kept
from gdfe_ros.solver.outcome import Outcome
from gdfe_ros.solver.vectors import Array, largest

RATE, SLOWEST = 0.3, 0.9
"""Ratio of the lengths of two successive steps: the value assumed at first, and an upper limit."""
UNPROVEN = 0.2
"""A minimisation without a converged predecessor ends before its first iteration only if its estimated distance,
divided by the target, is at most this.
"""
STRAIGHT, FOLLOWED = 3e-3, 1e-2
"""Displacements divided by the body's size. Steps up to the first are straight, longer steps follow arcs. After a total
displacement above the second, the rotations of the vertices are computed anew.
"""
WILD, TAME = 1.0, 0.1
"""Lengths of steps divided by the body's size. If elements are nearly folded and the tangent lacks their barriers,
steps become too long. Beyond the first length, the constant matrix replaces the tangent until steps are shorter than
the second length.
"""
ENDLESS = sys.maxsize
"""Number of iterations for which a matrix serves if nothing limits it."""
MOST_FLAT = 60
"""The minimisation ends after this number of iterations without progress: the energy fell by no more than rounding, and
the length of the step did not fall to half of its least value.
"""


class Metric(NamedTuple):
    """The initial matrix M of a minimisation, and scratch.

    Attributes:
        kept: factor of the tangent; without rows if M is the constant matrix.
        coupling: the constant matrix, and its coupling to the rigid rows of handles.
        before: (n, 3) positions [m] at which the tangent was evaluated.
        held: whether the body has handles or obstacles, so that vertices rotate separately (see `vertex_rotations`).
        trust: assumed least ratio of a step to the distance to the equilibrium; 1 for a tangent.
        weight: (m,) weights of the elements in the constant matrix [Pa].
        u, gradient, x, force, sums: scratch (3 r,), (3 r,), (n, 3), (m, c, 3) and (n, 9).
    """

    kept: Kept
    coupling: Coupling
    before: Array
    held: bool
    trust: float
    weight: Array
    u: Array
    gradient: Array
    x: Array
    force: Array
    sums: Array


@kernel
def precondition(metric, right, out):
    """Write the product of M^-1 and each row of ``right`` (k, 3 r) to the same row of ``out``."""
    if len(metric.kept.order) > 0:
        solve_kept(metric.kept, right, out)
    else:
        for k in range(len(right)):
            apply_inverse(right[k], metric.coupling, out[k])


@internal
def apply_initial(status, metric, right, out):
    """Write the product of M^-1 and each row of ``right`` (k, 3 r) to the same row of ``out``.

    If A replaces M (see `WILD`), the result is a multiple of the product with A^-1.
    """
    if status.wild == 0:
        precondition(metric, right, out)
        return
    for k in range(len(right)):
        apply_inverse(right[k], metric.coupling, out[k])
        for n in range(out.shape[1]):
            out[k, n] *= status.scale


@internal
def find_direction(work, metric):
    """Write the quasi-Newton direction, its slope [J] and its largest displacement [m]; return whether it descends."""
    status, d = work.status[0], work.direction
    begin_recursion(work)
    apply_initial(status, metric, work.step.reshape((1, -1)), d.reshape((1, -1)))
    end_recursion(work, d)
    for n in range(len(d)):
        d[n] = -d[n]
    status.slope, status.step = inner(work.gradient, d), largest(d)
    return status.slope < 0.0


@internal
def choose_direction(problem, work, metric, size):
    """Write a direction of descent, with the constant matrix if the tangent's step is too long (see `WILD`).

    Return whether there is such a direction. If the history gives no direction of descent, the history is dropped.
    """
    status = work.status[0]
    descends = find_direction(work, metric)
    if status.wild == 1 and status.step < TAME * size:
        status.wild = 0
        descends = find_direction(work, metric)
    if not descends and status.count > 0 and status.step > 0.0:
        status.count = 0
        descends = find_direction(work, metric)
    folded = problem.watch.count[0] > 0 and len(metric.kept.order) > 0
    if status.wild == 0 and status.step > WILD * size and folded:
        status.wild, status.scale, status.count = 1, 1.0, 0
        descends = find_direction(work, metric)
    return descends


@internal
def rescale(work, metric):
    """Scale the constant matrix to the curvature of the newest pair."""
    status = work.status[0]
    newest = (status.head - 1) % len(work.curvature)
    y, z = work.changes[newest], metric.u
    apply_inverse(y, metric.coupling, z)
    status.scale = work.curvature[newest] / inner(y, z)


@internal
def measure(status, trust):
    """Estimate the distance to the equilibrium [m] from the length of the step and the ratio of successive lengths."""
    rate = min(status.step / status.before, SLOWEST) if status.before < math.inf else status.rate
    status.distance = status.step / (trust * (1.0 - max(rate, status.rate)))
    status.rate = rate


@internal
def is_exhausted(status):
    """Count an iteration without progress; return whether there are too many."""
    status.plateau += 1
    if status.step < 0.5 * status.nearest:
        status.nearest, status.plateau = status.step, 0
    return status.plateau > MOST_FLAT


@internal
def choose(problem, work, metric, size, most):
    """Write the next direction; return 2 if the energy falls along it, 1 if not, 0 after ``most`` uses of M."""
    status = work.status[0]
    if status.since >= most:
        status.ended = Outcome.WORN
        return 0
    if status.turned > FOLLOWED * size and len(metric.kept.order) > 0:
        rows = problem.unknowns.free, problem.unknowns.fixed
        given = rows, metric.held, metric.sums, metric.kept.frames
        vertex_rotations(work.x, metric.before, problem.shape, *given)
        status.turned = 0.0
    return 2 if choose_direction(problem, work, metric, size) else 1


@internal
def move(problem, work, metric, size, target, proven, descends):
    """Step along the chosen direction, unless the minimisation ends; return whether the minimisation goes on."""
    status, first = work.status[0], size < 0.0  # not a literal: numba would compile another copy of `advance` for it
    if status.step == 0.0:
        status.distance, status.ended = 0.0, Outcome.NEAR
        return False
    if not descends:
        status.distance, status.ended = math.inf, Outcome.WORN
        return False
    measure(status, metric.trust)
    shown = proven or status.made > 0
    near = status.distance <= target * (1.0 if shown else UNPROVEN)
    if near and status.wild == 0:
        status.ended = Outcome.NEAR
        return False
    if is_exhausted(status):
        status.ended = Outcome.EXHAUSTED
        return False
    status.before = status.step
    if status.step > STRAIGHT * size and status.wild == 0:
        follow_arc(problem, work, metric)
    if not status.step <= status.reach:
        status.ended = Outcome.RUNAWAY
        return False
    if advance(problem, work, first):
        if status.count == 0:
            return False
        status.count, status.ended = 0, Outcome.NONE  # the pairs may be rounding
        return True
    status.turned += status.step
    status.made += 1
    status.since += 1
    if remember(work) and status.wild == 1:
        rescale(work, metric)
    return True


@internal
def start(problem, work):
    """Begin a minimisation: evaluate all terms at the unknowns."""
    status, first = work.status[0], len(work.u) >= 0
    status.before, status.rate, status.nearest = math.inf, RATE, math.inf
    status.made, status.blocked, status.plateau, status.ended = 0, 0, 0, Outcome.NONE
    advance(problem, work, first)


@kernel
def descend(problem, work, metric, size, target, proven, most, limit, begins):
    """Minimise until the distance to the equilibrium is at most ``target`` [m]; return the number of iterations.

    ``work.status[0].ended`` is the reason for the end; it is `Outcome.NONE` if ``limit`` iterations were made.

    Args:
        problem: constant data of the minimisation.
        work: its workspace.
        metric: the initial matrix.
        size: size of the body [m].
        target: allowed distance [m].
        proven: whether an earlier minimisation converged, so that the first step gives a reliable estimate of the
            distance.
        most: number of iterations for which one tangent serves.
        limit: largest number of iterations.
        begins: whether the minimisation begins, so that all terms are evaluated first.
    """
    if begins:
        start(problem, work)
    for iteration in range(limit):
        found = choose(problem, work, metric, size, most)
        if found == 0 or not move(problem, work, metric, size, target, proven, found == 2):
            return iteration
    return limit
