# SPDX-License-Identifier: Apache-2.0
"""Compiled Newton iterations: K d = -g by conjugate gradients, preconditioned by a kept factor M of an earlier tangent.

A product K p is a difference of gradients, so that no term needs a tangent of its own. Conjugate gradients end with an
error e of the Newton step. For the residual r, M^-1 K e = M^-1 r, so |e| is at most |M^-1 r| divided by the least
eigenvalue of M^-1 K. The least Ritz value theta estimates this eigenvalue. A single right-hand side may have no
component along a soft mode. Therefore the least theta since the factorisation of M is used.

After a full Newton step, the same formula with the new gradient as the residual bounds the distance to the
equilibrium.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.solver.descent.arc import follow_arc
from gdfe_ros.solver.descent.pairs import inner
from gdfe_ros.solver.descent.products import multiply
from gdfe_ros.solver.descent.quasi_newton import advance
from gdfe_ros.solver.distance import largest
from gdfe_ros.solver.tangent.substitution import solve_kept

MOST_PRODUCTS = 30
"""Largest number of products K p for one Newton step. Many are needed near buckling, or if the body's shape has changed
much since the factor was made.
"""
FORCING, INEXACT = 0.01, 0.15
"""Conjugate gradients end when the bound of the error |e| is below `FORCING` times the Newton step, or below `INEXACT`
times the target.
"""
STEADY = 0.5
"""Conjugate gradients end only if theta after the last product, divided by theta before it, is at least this. While
theta falls faster, softer modes are still being found.
"""
HALVINGS = 40
"""Number of bisections that find a least Ritz value."""
ROUNDING = 1e-20
"""Conjugate gradients end when r . M^-1 r, divided by its first value, is below this: the rest is rounding."""
HALF = 0.5
"""The iterations end after a Newton step if the distance is at most this fraction of the target. If the step is longer
than the target, the distance must also be at most this fraction of the step.
"""
CLOSE = 0.02
"""A computed Newton step is not made if the distance, divided by the target, is at most this. The limit is small,
because the errors of such solves add up along the softest mode, which a few products hardly resolve.
"""
ENERGY = 1e-5
"""Largest energy that another Newton step may release at the end of a solve, divided by the energy of all terms. Small
displacement errors of stiff parts store much energy.
"""
NOTHING = 1e-6
"""M^-1 g counts as rounding if its length, divided by the target, is below this."""
AWAY = 0.02
"""Length, divided by the body's size, of a step along negative curvature if no other direction is known, and limit of
the doubling steps that leave a saddle.
"""
FREE = 4
"""Number of matrix-vector products in each Newton step that are not counted; the others lead to a new tangent."""


class Why(IntEnum):
    """Reason why the Newton iterations ended."""

    NEAR = 0
    """The distance to the equilibrium is within the target."""
    LIMIT = 1
    """The limit of iterations is reached."""
    STALE = 2
    """The products with this factor have cost as much as a new tangent would cost, or the body has turned far."""
    ENDED = 3
    """No step is possible: see `End`."""
    ASTRAY = 4
    """Steps are far too long: the factor is almost singular."""
    HARD = 5
    """The line search shortened the last Newton step, or conjugate gradients did not converge: the energy is far from
    quadratic.
    """


class StepKind(IntEnum):
    """Result of the conjugate gradients for one Newton step."""

    FOUND = 0
    """The bound of the error |e| is small enough."""
    CURVED = 1
    """A direction of negative curvature was met."""
    UNKNOWN = 2
    """`MOST_PRODUCTS` products were not enough."""


COURSE = np.dtype(
    [
        ("least", np.float64),  # theta
        ("distance", np.float64),  # to the equilibrium [m]; infinite if it is not known
        ("spent", np.int64),  # products since the tangent was taken, beyond the free ones
        ("curved", np.int64),  # steps that met negative curvature
        ("unknown", np.int64),  # steps for which the products were not enough
    ]
)
"""Fields of the record of the Newton iterations of a solve."""


class Krylov(NamedTuple):
    """Work arrays of conjugate gradients.

    Attributes:
        direction, image, residual, z: (3 r,) p, K p, r, M^-1 r.
        step: (3 r,) the Newton step d [m].
        motion: (3 r,) the displacement v since the last equilibrium [m]; zero if it is not known.
        diagonal, beside: (`MOST_PRODUCTS`,) entries of Lanczos' tridiagonal matrix, on and beside the diagonal.
        force: (m, c, 3) [N] scratch.
        course: (1,) record with the fields of `COURSE`.
    """

    direction: NDArray[np.float64]
    image: NDArray[np.float64]
    residual: NDArray[np.float64]
    z: NDArray[np.float64]
    step: NDArray[np.float64]
    motion: NDArray[np.float64]
    diagonal: NDArray[np.float64]
    beside: NDArray[np.float64]
    force: NDArray[np.float64]
    course: NDArray[np.void]


def allocate_krylov(rows: int, cells: tuple[int, int]) -> Krylov:
    """Return work arrays for ``rows`` rows of unknowns and ``cells`` (m, c): elements, and corners of each."""
    vectors, force = [np.zeros(3 * rows) for _ in range(6)], np.zeros((*cells, 3))
    return Krylov(*vectors, *np.zeros((2, MOST_PRODUCTS)), force, np.zeros(1, dtype=COURSE).view(np.recarray))


@internal
def least_ritz(diagonal, beside, count):
    """Return the least eigenvalue of a positive definite tridiagonal matrix, by bisection."""
    low, high = 0.0, diagonal[0]
    for i in range(1, count):
        high = min(high, diagonal[i])
    for _ in range(HALVINGS):
        middle, pivot, below = 0.5 * (low + high), 1.0, False
        for i in range(count):
            pivot = diagonal[i] - middle - (beside[i - 1] * beside[i - 1] / pivot if i > 0 else 0.0)
            if pivot <= 0.0:
                below = True
                break
        if below:
            high = middle
        else:
            low = middle
    return high


@internal
def follow(krylov, length):
    """Add ``length`` times p to the Newton step, and subtract ``length`` times K p from the residual."""
    for n in range(len(krylov.step)):
        krylov.step[n] += length * krylov.direction[n]
        krylov.residual[n] -= length * krylov.image[n]


@internal
def begin_along(problem, work, beside, kept, krylov, spacing):
    """Start the Newton step d with its part along the motion v, from v^T (K d - r) = 0; return the number of products.

    A body moves along its softest mode. Forces along this mode are small, and conjugate gradients hardly resolve them.
    """
    v, r = krylov.motion, krylov.residual
    krylov.step[:] = 0.0
    if largest(v) == 0.0:
        return 0
    multiply(problem, work.u, work.gradient, beside, v, spacing, krylov.image)
    stiffness = inner(v, krylov.image)
    if stiffness > 0.0:
        krylov.direction[:] = v
        follow(krylov, inner(r, v) / stiffness)
        solve_kept(kept, r, krylov.z)
    return 1


@kernel
def solve_newton(problem, work, beside, kept, krylov, spacing, target, most_left):
    """Solve K d = r for the given residual and z = M^-1 r; return a `StepKind` and the number of products.

    Conjugate gradients start from the part of d along ``krylov.motion``. They end when three conditions hold: the
    error bound of d is small against d or against the ``target`` [m], theta has become steady (`STEADY`), and
    r . M^-1 r is at most the fraction ``most_left`` of its first value. If the first direction has negative curvature,
    d becomes this direction.
    """
    course = krylov.course[0]
    p, r, z, d = krylov.direction, krylov.residual, krylov.z, krylov.step
    made = begin_along(problem, work, beside, kept, krylov, spacing)
    p[:] = z
    weight = inner(r, z)
    start, length, ratio = weight, 1.0, 0.0
    if not weight > 0.0:
        found = largest(z) == 0.0
        course.distance = 0.0 if found else math.inf
        return StepKind.FOUND if found else StepKind.UNKNOWN, made
    for count in range(MOST_PRODUCTS):
        multiply(problem, work.u, work.gradient, beside, p, spacing, krylov.image)
        curvature = inner(p, krylov.image)
        if not curvature > 0.0:
            if count == 0:
                d[:] = p
            course.distance = math.inf
            return StepKind.CURVED, made + count + 1
        krylov.diagonal[count] = curvature / weight + (ratio / length if count > 0 else 0.0)
        length = weight / curvature
        follow(krylov, length)
        solve_kept(kept, r, z)
        last, weight, before = weight, inner(r, z), course.least
        course.least = min(before, least_ritz(krylov.diagonal, krylov.beside, count + 1))
        left, far = largest(z) / course.least, largest(d)
        small = left <= max(INEXACT * target, FORCING * far) and (count > 1 or left <= CLOSE * target)
        if (small and course.least >= STEADY * before and weight <= most_left * start) or not weight > ROUNDING * start:
            course.distance = far + left
            return StepKind.FOUND, made + count + 1
        ratio = weight / last
        krylov.beside[count] = math.sqrt(ratio) / length
        for n in range(len(d)):
            p[n] = z[n] + ratio * p[n]
    course.distance = math.inf
    return StepKind.UNKNOWN, MOST_PRODUCTS


@internal
def aim(work, krylov, share):
    """Write the Newton step times ``share`` to the search direction, with the sign for which the energy decreases."""
    status = work.status[0]
    slope = share * inner(work.gradient, krylov.step)
    if slope > 0.0:
        share, slope = -share, -slope
    for n in range(len(work.u)):
        work.direction[n] = share * krylov.step[n]
    status.slope, status.distance, status.given = slope, abs(share) * largest(krylov.step), 1


@internal
def reached(work, course, far, target, exact):
    """Return whether the ``target`` [m] is reached after a full step of length ``far`` [m].

    If ``exact``, the energy that another step may release must also be within `ENERGY`.
    """
    status, left = work.status[0], largest(work.step) / course.least
    if left > HALF * target or (left > HALF * far and far > target):
        return False
    released = 0.5 * inner(work.gradient, work.step)
    return not exact or released <= ENERGY * course.least * (status.absolute + status.outside)


@kernel
def iterate(problem, work, beside, kept, krylov, weight, inverse, size, spacing, target, exact, worth, limit):
    """Make Newton steps until the distance to the equilibrium is within the ``target`` [m].

    Return the reason for the end, a `Why`, and the number of Newton steps. At the start, ``work`` must contain the
    gradient, and as ``step`` the product of M^-1 and the gradient. Both are up to date again at the end. ``size`` is
    the size of the body [m]. With ``exact``, the energy must also have settled. After ``worth`` products a new tangent
    pays. The elements' ``weight`` in the constant matrix and its ``inverse`` are for `follow_arc`.
    """
    course, first = krylov.course[0], limit < 0
    for iteration in range(limit):
        if course.spent >= worth:
            return Why.STALE, iteration
        if largest(work.step) <= NOTHING * target:
            course.distance = largest(work.step) / course.least
            return Why.NEAR, iteration
        for n in range(len(work.u)):
            krylov.residual[n], krylov.z[n] = -work.gradient[n], -work.step[n]
        solved, products = solve_newton(problem, work, beside, kept, krylov, spacing, target, math.inf)
        course.spent += max(0, products - FREE)
        if solved == StepKind.FOUND and course.distance <= CLOSE * target:
            return Why.NEAR, iteration
        course.curved += solved == StepKind.CURVED
        course.unknown += solved == StepKind.UNKNOWN
        far = largest(krylov.step)
        if far == 0.0:
            return Why.HARD, iteration
        alone = solved == StepKind.CURVED and products == (2 if largest(krylov.motion) > 0.0 else 1)
        share = AWAY * size / far if alone else 1.0
        aim(work, krylov, share)
        share *= follow_arc(problem, work, beside, weight, inverse, krylov.force)
        if advance(problem, work, 0.0, first):
            return Why.ENDED, iteration
        solve_kept(kept, work.gradient, work.step)
        smooth = solved == StepKind.FOUND and work.status[0].length == 1.0
        if smooth and share == 1.0 and reached(work, course, far, target, exact):
            course.distance = largest(work.step) / course.least
            return Why.NEAR, iteration + 1
        course.distance = math.inf
        if not smooth:
            return Why.HARD, iteration + 1
        course.spent = max(course.spent, worth * (share < 1.0))  # a body that turned far needs a new tangent
    return Why.LIMIT, limit
