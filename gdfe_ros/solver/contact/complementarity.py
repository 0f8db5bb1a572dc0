# SPDX-License-Identifier: Apache-2.0
"""Compiled complementarity problem of contact: Signorini's and Coulomb's laws on a compliance matrix.

Each of c points has a force f = (f_n, f_t) [N] and a relative displacement p = (p_n, p_t) [m]: its gap, and its slip
since the step began. Within one quasi-Newton step they depend linearly on all forces, p = q + W f. The laws are

    p_n >= 0,  f_n >= 0,  f_n p_n = 0;      |f_t| <= mu f_n,  and f_t = -mu f_n p_t / |p_t| where p_t is not zero.

With any r > 0 they are equivalent to the equations of Alart and Curnier (1991),

    f_n = max(0, f_n - r p_n),      f_t = the point of the disc |t| <= mu f_n nearest to f_t - r p_t.

A semismooth Newton method solves these equations. Each iteration classifies the points as free, sticking or slipping,
and solves one linear system in the forces of the touching points. Block Gauss-Seidel sweeps over the points give the
start, and replace Newton iterations that do not reduce the violation. Sweeps always make progress, but stall where
neighbouring points are almost equally compliant.
"""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import internal, kernel, vector_kernel

SWEEPS, MOST_SWEEPS, MOST_NEWTON, MOST_FIRM, ROUNDS = 12, 2000, 12, 40, 30
"""Number of Gauss-Seidel sweeps before Newton iterations; limit up to which this number doubles if Newton fails;
largest numbers of successive Newton iterations with the compliances `RIDGE` and `FIRM`; largest number of rounds of
sweeps and Newton iterations.
"""
HALF, WORSE = 0.5, 1.5
"""A negligible violation ends the search once a round no longer reduces it to the first fraction. Points that touch at
the same place, such as vertex on vertex, contradict each other by amounts of second order in the step. If the laws have
no solution, bounded forces are accepted if they violate the laws by at most the second number times the least
violation.
"""
MANY, BRISK = 150, 0.3
"""With more unknown forces than the first number, sweeps come first, as long as each dozen of them lowers the violation
below the second number times its last value.
"""
FINER = 1e-3
"""With at most `MANY` unknown forces, a further Newton iteration costs little. Newton's method then aims at this
fraction of the tolerance.
"""
LARGEST = 900
"""Largest number of unknown forces for which Newton's linear systems are solved."""
RIDGE, FIRM, IMMOVABLE = 1e-9, 5e-3, 1e-13
"""Two compliances, divided by the compliance of each force, that are added to Newton's matrix, because forces of
redundant points, such as the four corners of a rigid box, are not unique. If Newton's method fails with the first
compliance, every other round uses the second. Without it, the forces of a stack would jump far in directions that are
not unique, and points would alternate between states. A point cannot move along an axis if its compliance, divided by
the largest of all, is at most the third number.
"""


@vector_kernel
def row_product(w, f, i):
    """Return the product of row ``i`` of ``w`` and ``f``."""
    total = 0.0
    for j in range(len(f)):
        total += w[i, j] * f[j]
    return total


@internal
def displace(w, q, f, p):
    """Write the displacements p = q + W f [m]."""
    for i in range(len(q)):
        p[i] = q[i] + row_product(w, f, i)


@internal
def tangential_compliance(w, i):
    """Return the larger tangential compliance [m/N] of point ``i``."""
    return max(w[3 * i + 1, 3 * i + 1], w[3 * i + 2, 3 * i + 2])


@internal
def onto_disc(w, mu, f, slip, i, press):
    """Return the friction force of point ``i`` (two numbers) [N] on Coulomb's disc that is nearest to the trial force.

    The trial force is f_t - r p_t with the ``slip`` p_t (two numbers) [m]; the disc has the radius mu ``press`` [N].
    """
    n, k, limit = 3 * i, tangential_compliance(w, i), mu[i] * press
    a, b = f[n + 1] - slip[0] / k, f[n + 2] - slip[1] / k
    trial = math.sqrt(a * a + b * b)
    share = limit / trial if trial > limit else 1.0
    return share * a, share * b


@internal
def violation(w, mu, f, p, i):
    """Return the violation of the laws [m] by point ``i`` at forces ``f`` and displacements ``p``."""
    n = 3 * i
    k, (a, b) = tangential_compliance(w, i), onto_disc(w, mu, f, (p[n + 1], p[n + 2]), i, max(0.0, f[n]))
    pressed = w[n, n] * abs(f[n] - max(0.0, f[n] - p[n] / w[n, n]))
    return max(pressed, k * abs(f[n + 1] - a), k * abs(f[n + 2] - b))


@internal
def residual(w, mu, f, p):
    """Return the largest violation of the laws [m] at forces ``f`` and displacements ``p``."""
    worst = 0.0
    for i in range(len(mu)):
        worst = max(worst, violation(w, mu, f, p, i))
    return worst


@kernel
def find_violations(w, q, mu, f, out):
    """Write the violation of the laws [m] by each point to ``out`` (c,); the arguments are those of `solve_laws`."""
    p = np.empty(len(q))
    displace(w, q, f, p)
    for i in range(len(mu)):
        out[i] = violation(w, mu, f, p, i)


@kernel
def sweep(w, mu, f, p):
    """Solve the laws of one point after the other at constant forces of all others; update ``f``, and ``p`` with it."""
    for i in range(len(mu)):
        n = 3 * i
        press = max(0.0, f[n] - p[n] / w[n, n])
        d = press - f[n]
        a, b = onto_disc(w, mu, f, (p[n + 1] + w[n, n + 1] * d, p[n + 2] + w[n, n + 2] * d), i, press)
        da, db = a - f[n + 1], b - f[n + 2]
        if d != 0.0 or da != 0.0 or db != 0.0:
            f[n], f[n + 1], f[n + 2] = press, a, b
            for j in range(len(p)):
                p[j] += w[n, j] * d + w[n + 1, j] * da + w[n + 2, j] * db


@internal
def classify(w, q, mu, f, p, on):
    """Decide which points touch, and return the number of forces that Newton's method has to find.

    The indices of these forces are written to ``on``. The forces ``f`` of points that do not touch, and the tangential
    forces of points with friction coefficient zero, are set to zero. Then the displacements ``p`` are computed again
    from ``f``.
    """
    count = 0
    for i in range(len(mu)):
        n = 3 * i
        touches = f[n] - p[n] / w[n, n] > 0.0
        if not touches:
            f[n], f[n + 1], f[n + 2] = 0.0, 0.0, 0.0
        elif mu[i] == 0.0:
            f[n + 1], f[n + 2] = 0.0, 0.0
        f[n] = max(0.0, f[n])
        if touches:
            on[count] = n
            count += 1
        if touches and mu[i] > 0.0:
            on[count], on[count + 1] = n + 1, n + 2
            count += 2
    displace(w, q, f, p)
    return count


@internal
def solve_dense(matrix, right):
    """Return the solution of a dense system; zero if the matrix is singular."""
    try:
        return np.linalg.solve(matrix, right)
    except Exception:
        return np.zeros(len(right))


@internal
def newton_step(w, mu, f, p, on, ridge):
    """Return the change [N] of the forces with the indices ``on`` in one semismooth Newton iteration."""
    count, k = len(on), 0
    matrix, right = np.zeros((count, count)), np.zeros(count)
    while k < count:
        n = on[k]
        i = n // 3
        for j in range(count):
            matrix[k, j] = w[n, on[j]]
        matrix[k, k] += ridge * w[n, n]
        right[k] = -p[n]
        if mu[i] == 0.0:
            k += 1
            continue
        r, limit = 1.0 / tangential_compliance(w, i), mu[i] * f[n]
        a, b = f[n + 1] - r * p[n + 1], f[n + 2] - r * p[n + 2]
        trial = math.sqrt(a * a + b * b)
        if trial <= limit:
            for axis in range(1, 3):
                for j in range(count):
                    matrix[k + axis, j] = w[n + axis, on[j]]
                matrix[k + axis, k + axis] += ridge * w[n + axis, n + axis]
                right[k + axis] = -p[n + axis]
        else:
            a, b, share = a / trial, b / trial, limit / trial
            # The derivative of f_t - mu f_n a/|a|: the part of a/|a| across the direction of slip changes with p
            for axis in range(1, 3):
                along = a if axis == 1 else b
                first = share * ((1.0 if axis == 1 else 0.0) - along * a)
                second = share * ((1.0 if axis == 2 else 0.0) - along * b)
                for j in range(count):
                    matrix[k + axis, j] = r * (first * w[n + 1, on[j]] + second * w[n + 2, on[j]])
                matrix[k + axis, k] -= mu[i] * along
                matrix[k + axis, k + 1] -= first
                matrix[k + axis, k + 2] -= second
                matrix[k + axis, k + axis] += 1.0
                right[k + axis] = limit * along - f[n + axis]
        k += 3
    return solve_dense(matrix, right)


@internal
def newton(w, q, mu, f, p, best, tolerance, faint, ridge, most):
    """Make Newton iterations; return the least violation [m] and write its forces to ``best``."""
    least, on, aim, idle = math.inf, np.empty(len(q), np.int64), tolerance, 0
    if len(q) <= MANY:
        aim *= FINER
    for _ in range(most):
        found = residual(w, mu, f, p)
        idle = idle + 1 if found > HALF * least else 0
        if found < least:
            least = found
            best[:] = f
        if (
            (idle > 1 and least <= faint)
            or least <= aim
            or not math.isfinite(found)
            or (least <= tolerance and found > least)
        ):
            break
        count = classify(w, q, mu, f, p, on)
        if count == 0:
            continue
        if count > LARGEST:
            break
        change = newton_step(w, mu, f, p, on[:count], ridge)
        for k in range(count):
            f[on[k]] += change[k]
        displace(w, q, f, p)
    return least


@internal
def sweep_often(w, q, mu, start, f, p, sweeps):
    """Make a number of ``sweeps`` from the forces ``start``; write the forces to ``f``, the displacements to ``p``."""
    f[:] = start
    displace(w, q, f, p)
    for _ in range(sweeps):
        sweep(w, mu, f, p)
    displace(w, q, f, p)


@internal
def bound_forces(w, q, mu, f, p, least, tolerance):
    """Replace the forces ``f``, which violate the laws by ``least`` [m], by bounded forces unless these are much worse.

    Return the violation [m]. The bounded forces solve the laws with slightly more compliant points (`FIRM`). The laws
    have no solution, for example, for a rigid body between two obstacles that approach: forces would then grow in each
    iteration.
    """
    soft, found, best = w.copy(), np.zeros(len(f)), np.zeros(len(f))
    for n in range(len(f)):
        soft[n, n] *= 1.0 + FIRM
    displace(soft, q, found, p)
    newton(soft, q, mu, found, p, best, tolerance, tolerance, RIDGE, MOST_FIRM)
    displace(w, q, best, p)
    left = residual(w, mu, best, p)
    if not left <= WORSE * least:
        return least
    f[:] = best
    return left


@internal
def hold_immovable(w, q, f):
    """Give each row of ``w`` without compliance one with which its force in ``f`` stays, whatever the other forces are.

    A handle may hold a point in some directions only. Forces in these directions move nothing. The compliance is so
    small that later calls find the row again.
    """
    largest = 0.0
    for n in range(len(q)):
        largest = max(largest, w[n, n])
    largest = largest if largest > 0.0 else 1.0
    for n in range(len(q)):
        if w[n, n] <= IMMOVABLE * largest:
            w[n, :], w[:, n] = 0.0, 0.0
            w[n, n] = IMMOVABLE * largest
            q[n] = -w[n, n] * f[n]


@kernel
def solve_laws(w, q, mu, f, tolerance, faint):
    """Write the forces that satisfy the laws to ``f``, and return the largest violation [m] that remains.

    Forces along axes in which a point cannot move stay as they are; their rows of ``w`` and ``q`` are replaced.

    Args:
        w: (3 c, 3 c) [m/N] compliance W, symmetric; each point has its normal and two tangents.
        q: (3 c,) [m] displacements p without contact forces.
        mu: (c,) friction coefficients.
        f: (3 c,) [N] forces from which the search starts, and the result.
        tolerance: wanted violation [m].
        faint: negligible violation [m], accepted if the tolerance cannot be reached.
    """
    p, best, trial = np.empty(len(q)), f.copy(), f.copy()
    hold_immovable(w, q, f)
    displace(w, q, f, p)
    last, brisk = residual(w, mu, f, p), len(q) > MANY
    if last <= (tolerance if brisk else FINER * tolerance):
        return last
    while brisk:
        for _ in range(SWEEPS):
            sweep(w, mu, f, p)
            found = residual(w, mu, f, p)
            if found <= tolerance:
                return found
        brisk, last = found < BRISK * last, found
    displace(w, q, f, p)
    least = newton(w, q, mu, f, p, best, tolerance, faint, RIDGE, MOST_NEWTON)
    sweeps, halved = SWEEPS, True
    for number in range(ROUNDS):
        if least <= tolerance or (least <= faint and not halved) or sweeps > MOST_SWEEPS:
            break
        sweep_often(w, q, mu, best, f, p, sweeps)
        ridge, most = (RIDGE, MOST_NEWTON) if number % 2 else (FIRM, MOST_FIRM)
        found = newton(w, q, mu, f, p, trial, tolerance, faint, ridge, most)
        halved = found <= HALF * least
        if found < least:
            least = found
            best[:] = trial
        elif least > faint:
            sweeps *= 2
            sweep_often(w, q, mu, best, f, p, sweeps)
            best[:] = f
            least = residual(w, mu, f, p)
    f[:] = best
    return least if least <= faint else bound_forces(w, q, mu, f, p, least, tolerance)
