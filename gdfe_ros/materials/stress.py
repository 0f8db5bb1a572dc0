# SPDX-License-Identifier: Apache-2.0
"""Compiled energy densities W [J/m^3] and first Piola-Kirchhoff stresses P = dW/dF [Pa] of the laws.

docs/theory/energy.md derives them. A matrix is a tuple of nine floats, row by row. ``k`` is the material's row in the
table. Below a smallest volume ratio or stretch, each law is extrapolated, so that a finite force restores an inverted
element (Stomakhin et al. 2012).
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, internal
from gdfe_ros.materials.table import END, GENT, INTERVALS, INVARIANT, LIMIT, OGDEN, POWERS, SHEAR, TERMS
from gdfe_ros.materials.tensor import cofactor, determinant, squared_norm

LEAST_VOLUME = 0.1
"""Volume ratio J below which parabolas (C2) replace the logarithms of the neo-Hookean law."""
LEAST_STRETCH = 0.1
"""Principal stretch below which Ogden's law is extrapolated to second order (C1)."""
CURVE_FACTOR = 1.5 / (1.5 * 1.5)
"""Ratio of eps_eq^2 to |F - lam R|^2: 3 / (2 (1 + nu)^2) with nu = 0.5."""


@inlined
def volumetric(j, pressure, kappa):
    """Return p (J - 1) + kappa/2 (J - 1)^2 and its derivative with respect to J; p is positive in tension."""
    change = j - 1.0
    return change * (pressure + 0.5 * kappa * change), pressure + kappa * change


@inlined
def logarithmic_volume(j, lame):
    """Return lambda/2 (ln J)^2 and its derivative with respect to J; below `LEAST_VOLUME` it is a parabola (C2)."""
    least = max(j, LEAST_VOLUME)
    below, log = j - least, math.log(least)
    slope, curvature = lame * log / least, lame * (1.0 - log) / (least * least)
    return 0.5 * lame * log * log + below * (slope + 0.5 * curvature * below), slope + curvature * below


@inlined
def corotated_stress(f, r, lam, factor, slope, c):
    """Return the stress ``factor`` (F - lam R) + ``slope`` cof F; ``c`` is cof F."""
    return (
        factor * (f[0] - lam * r[0]) + slope * c[0],
        factor * (f[1] - lam * r[1]) + slope * c[1],
        factor * (f[2] - lam * r[2]) + slope * c[2],
        factor * (f[3] - lam * r[3]) + slope * c[3],
        factor * (f[4] - lam * r[4]) + slope * c[4],
        factor * (f[5] - lam * r[5]) + slope * c[5],
        factor * (f[6] - lam * r[6]) + slope * c[6],
        factor * (f[7] - lam * r[7]) + slope * c[7],
        factor * (f[8] - lam * r[8]) + slope * c[8],
    )


@inlined
def curve_state(strain, table, k):
    """Return Phi [J/m^3], Phi'/eps_eq [Pa] and the tangent d sigma / d e [Pa] of a curve at eps_eq = ``strain``."""
    position = strain / table.width[k]
    if position >= INTERVALS:
        beyond = strain - INTERVALS * table.width[k]
        value, slope = table.curve[k, INTERVALS, 0], table.curve[k, INTERVALS, 1] / table.width[k]
        phi = table.curve[k, INTERVALS, 4] + beyond * (value + 0.5 * slope * beyond)
        return phi, (value + slope * beyond) / strain, table.tangent[k, INTERVALS]
    i = int(position)
    t = position - i
    c0, c1, c2, c3 = table.curve[k, i, 0], table.curve[k, i, 1], table.curve[k, i, 2], table.curve[k, i, 3]
    phi = table.curve[k, i, 4] + table.width[k] * t * (c0 + t * (c1 / 2.0 + t * (c2 / 3.0 + t * c3 / 4.0)))
    rise = c1 + t * (c2 + t * c3)
    secant = rise / table.width[k] if i == 0 else (c0 + t * rise) / strain
    return phi, secant, (1.0 - t) * table.tangent[k, i] + t * table.tangent[k, i + 1]


@inlined
def neo_hookean(f, pressure, mu, lame, kappa):
    """Return W and P of W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2 + p (J - 1) + kappa/2 (J - 1)^2.

    Below `LEAST_VOLUME`, parabolas (C2) replace the terms with ln J. The code has no branches, so that it vectorises.
    """
    c = cofactor(f)
    j = determinant(f, c)
    change = j - 1.0
    least = max(j, LEAST_VOLUME)
    below = j - least
    log = math.log(least)
    rate = (lame * log - mu) / least
    curvature = (mu + lame * (1.0 - log)) / (least * least)
    w = 0.5 * mu * (squared_norm(f) - 3.0) + (0.5 * lame * log - mu) * log + below * (rate + 0.5 * curvature * below)
    w += change * (pressure + 0.5 * kappa * change)
    return w, corotated_stress(f, f, 0.0, mu, pressure + kappa * change + rate + curvature * below, c)


@inlined
def stable_neo_hookean(f, pressure, mu, kappa):
    """Return W and P of the law of `StableNeoHookean`, with p (J - 1) + kappa/2 (J - 1)^2 as its volume energy.

    P = 4/3 mu (1 - 1/(I1 + 1)) F + (p + kappa (J - 1) - mu) cof F
    """
    c = cofactor(f)
    first, change = squared_norm(f), determinant(f, c) - 1.0
    w = 2.0 / 3.0 * mu * (first - 3.0 - math.log(0.25 * (first + 1.0)))
    w += change * (pressure - mu + 0.5 * kappa * change)
    return w, corotated_stress(f, f, 0.0, 4.0 / 3.0 * mu * first / (first + 1.0), pressure - mu + kappa * change, c)


@inlined
def isochoric_powers(l0, l1, l2, alpha):
    """Return the isochoric stretches of the principal stretches (l0, l1, l2) to the power alpha."""
    n0, n1, n2 = math.log(l0), math.log(l1), math.log(l2)
    mean = (n0 + n1 + n2) / 3.0
    e0, e1 = math.exp(alpha * (n0 - mean)), math.exp(alpha * (n1 - mean))
    return e0, e1, 1.0 / (e0 * e1)


@inlined
def ogden_powers(l0, l1, l2, table, k, term):
    """Return mu and alpha of a term, and the isochoric stretches of (l0, l1, l2) to the power alpha."""
    mu, alpha = table.parameters[k, OGDEN + 2 * term], table.parameters[k, OGDEN + 2 * term + 1]
    return mu, alpha, *isochoric_powers(l0, l1, l2, alpha)


@inlined
def invariant_energy(x, table, k):
    """Return W(x) [J/m^3], dW/dx and d2W/dx2 [Pa] of a law of the first invariant at x = I1 - 3 (`InvariantLaw`)."""
    inside = min(x, table.parameters[k, END])
    w, first, second = 0.0, 0.0, 0.0
    for i in range(POWERS + 4, POWERS - 1, -1):
        second = second * inside + 2.0 * first
        first = first * inside + w
        w = w * inside + table.parameters[k, i]
    second = second * inside + 2.0 * first
    first = first * inside + w
    w = w * inside
    mu, limit = table.parameters[k, GENT], table.parameters[k, LIMIT]
    if mu > 0.0:
        left = 1.0 - inside / limit
        w -= 0.5 * mu * limit * math.log(left)
        first += 0.5 * mu / left
        second += 0.5 * mu / (limit * left * left)
    beyond = x - inside
    if beyond > 0.0:
        second = max(second, 0.0)
        w += beyond * (first + 0.5 * second * beyond)
        first += second * beyond
    return w, first, second


@inlined
def ogden_terms(l0, l1, l2, table, k):
    """Return the isochoric energy W, and its derivatives with respect to the three principal stretches.

    W is the sum of Ogden's terms, and of the energy of a law of the first invariant.
    """
    w, t0, t1, t2 = 0.0, 0.0, 0.0, 0.0
    for term in range(int(table.parameters[k, TERMS])):
        mu, alpha, e0, e1, e2 = ogden_powers(l0, l1, l2, table, k, term)
        total = e0 + e1 + e2
        factor = 2.0 * mu / alpha
        w += factor / alpha * (total - 3.0)
        t0 += factor * (e0 - total / 3.0)
        t1 += factor * (e1 - total / 3.0)
        t2 += factor * (e2 - total / 3.0)
    if table.parameters[k, INVARIANT] > 0.0:
        e0, e1, e2 = isochoric_powers(l0, l1, l2, 2.0)
        total = e0 + e1 + e2
        more, first, _ = invariant_energy(total - 3.0, table, k)
        w += more
        t0 += 2.0 * first * (e0 - total / 3.0)
        t1 += 2.0 * first * (e1 - total / 3.0)
        t2 += 2.0 * first * (e2 - total / 3.0)
    return w, (t0 / l0, t1 / l1, t2 / l2)


@internal
def ogden_mixed(l0, l1, l2, d0, d1, d2, table, k):
    """Return the Hessian of W with respect to the stretches, times a change (d0, d1, d2) of the stretches."""
    m0, m1, m2 = 0.0, 0.0, 0.0
    u0, u1, u2 = d0 / l0, d1 / l1, d2 / l2
    for term in range(int(table.parameters[k, TERMS])):
        mu, alpha, e0, e1, e2 = ogden_powers(l0, l1, l2, table, k, term)
        total = e0 + e1 + e2
        mean, weighted = (u0 + u1 + u2) / 3.0, (e0 * u0 + e1 * u1 + e2 * u2) / 3.0
        factor = 2.0 * mu / alpha
        m0 += 2.0 * mu * (e0 * (u0 - mean) - weighted + total * mean / 3.0) - factor * (e0 - total / 3.0) * u0
        m1 += 2.0 * mu * (e1 * (u1 - mean) - weighted + total * mean / 3.0) - factor * (e1 - total / 3.0) * u1
        m2 += 2.0 * mu * (e2 * (u2 - mean) - weighted + total * mean / 3.0) - factor * (e2 - total / 3.0) * u2
    if table.parameters[k, INVARIANT] > 0.0:
        e0, e1, e2 = isochoric_powers(l0, l1, l2, 2.0)
        total, mean = e0 + e1 + e2, (u0 + u1 + u2) / 3.0
        c0, c1, c2 = 2.0 * e0 * (u0 - mean), 2.0 * e1 * (u1 - mean), 2.0 * e2 * (u2 - mean)
        change = c0 + c1 + c2
        _, first, second = invariant_energy(total - 3.0, table, k)
        rise = second * change
        m0 += 2.0 * (rise - first * u0) * (e0 - total / 3.0) + 2.0 * first * (c0 - change / 3.0)
        m1 += 2.0 * (rise - first * u1) * (e1 - total / 3.0) + 2.0 * first * (c1 - change / 3.0)
        m2 += 2.0 * (rise - first * u2) * (e2 - total / 3.0) + 2.0 * first * (c2 - change / 3.0)
    return m0 / l0, m1 / l1, m2 / l2


@inlined
def ogden_continued(l0, l1, l2, table, k):
    """Return W and its derivatives with respect to the signed stretches, extrapolated below `LEAST_STRETCH`.

    With l_min = `LEAST_STRETCH`, the extrapolated energy is W + sum_i (W_i d_i + s/2 d_i^2). W and W_i are evaluated at
    the stretches max(l_i, l_min), d_i = min(l_i - l_min, 0), and s = mu0 / l_min^2. ``l2`` is the smallest stretch.
    """
    c0, c1, c2 = max(l0, LEAST_STRETCH), max(l1, LEAST_STRETCH), max(l2, LEAST_STRETCH)
    w, g = ogden_terms(c0, c1, c2, table, k)
    if l2 >= LEAST_STRETCH:
        return w, g
    d0, d1, d2 = l0 - c0, l1 - c1, l2 - c2
    m0, m1, m2 = ogden_mixed(c0, c1, c2, d0, d1, d2, table, k)
    stiffness = table.parameters[k, SHEAR] / (LEAST_STRETCH * LEAST_STRETCH)
    w += g[0] * d0 + g[1] * d1 + g[2] * d2 + 0.5 * stiffness * (d0 * d0 + d1 * d1 + d2 * d2)
    return w, (
        g[0] + (stiffness * d0 if d0 < 0.0 else m0),
        g[1] + (stiffness * d1 if d1 < 0.0 else m1),
        g[2] + (stiffness * d2 if d2 < 0.0 else m2),
    )
