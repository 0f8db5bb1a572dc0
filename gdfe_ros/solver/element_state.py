# SPDX-License-Identifier: Apache-2.0
"""Compiled updates between descents: the pressure that keeps an element's volume, and its shape factor's share."""

from __future__ import annotations

import math

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.materials.stress import curve_state
from gdfe_ros.materials.table import BULK, CARRIED, PENALTY, POISSON, SHEAR
from gdfe_ros.materials.tensor import cofactor, determinant, squared_norm, stretch_sum

LINEAR, NEO_HOOKEAN = 0, 1
LEAST_SHARE, MOST_SHARE = 0.25, 4.0
"""Bounds of the hourglass stiffness over that at rest: an element that softens much stays clear of hourglassing, one
that stiffens much keeps the constant matrix a good preconditioner."""
NEWTON_STEPS = 20


@internal
def mean_gradient(x, shape, e):
    """Return the mean deformation gradient of element ``e`` at positions ``x`` (n, 3)."""
    f0, f1, f2, f3, f4, f5, f6, f7, f8 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(8):
        v = shape.cells[e, a]
        x0, x1, x2 = x[v, 0], x[v, 1], x[v, 2]
        g0, g1, g2 = shape.gradient[e, a, 0], shape.gradient[e, a, 1], shape.gradient[e, a, 2]
        f0 += x0 * g0
        f1 += x0 * g1
        f2 += x0 * g2
        f3 += x1 * g0
        f4 += x1 * g1
        f5 += x1 * g2
        f6 += x2 * g0
        f7 += x2 * g1
        f8 += x2 * g2
    return f0, f1, f2, f3, f4, f5, f6, f7, f8


@internal
def volume_at(total, table, k):
    """Return J* with U'(J*) = total for the volume energy U of material ``k``."""
    bulk = table.parameters[k, BULK]
    if table.law[k] != NEO_HOOKEAN or bulk == math.inf:
        return 1.0 + total / bulk
    lame = bulk - 2.0 / 3.0 * table.parameters[k, SHEAR]
    slope = min(total / lame, 0.3)
    j = 1.0 + slope
    for _ in range(NEWTON_STEPS):
        step = (math.log(j) - slope * j) / (1.0 / j - slope)
        j = max(j - step, 0.1 * j)
        if abs(step) < 1e-15:
            break
    return j


@kernel
def update_pressures(x, elements, shape, material, table, pressure):
    """Replace p_e of ``elements`` by p - kappa (J* - 1), p = p_e + kappa (J - 1); return largest and mean |J - J*|."""
    worst, mean, volume = 0.0, 0.0, 0.0
    for e in elements:
        k = material[e]
        if table.parameters[k, CARRIED] == 0.0:
            continue
        kappa = table.parameters[k, PENALTY]
        f = mean_gradient(x, shape, e)
        j = determinant(f, cofactor(f))
        total = pressure[e] + kappa * (j - 1.0)
        target = volume_at(total, table, k)
        worst = max(worst, abs(j - target))
        mean += shape.volume[e] * abs(j - target)
        volume += shape.volume[e]
        pressure[e] = total - kappa * (target - 1.0)
    return worst, mean / max(volume, 1e-300)


@internal
def equivalent_strain(f, c, j, table, k):
    """Return eps_eq of Eq. 5 (nu = 0.5, but the element's own for the linear law)."""
    first = squared_norm(f)
    s = stretch_sum(first, squared_norm(c), j)
    nu = table.parameters[k, POISSON] if table.law[k] == LINEAR else 0.5
    return math.sqrt(max(1.5 * (first - s * s / 3.0), 0.0)) / (1.0 + nu)


@internal
def strain_state(x, shape, e, table, k):
    """Return eps_eq, J, secant and tangent modulus [Pa] of element ``e`` of material ``k``."""
    f = mean_gradient(x, shape, e)
    c = cofactor(f)
    j = determinant(f, c)
    strain = equivalent_strain(f, c, j, table, k)
    _, secant, tangent = curve_state(strain, table, k)
    return strain, j, secant, tangent


@internal
def softened_share(tangent, table, k):
    """Return the hourglass stiffness over that at rest of an element with this tangent modulus [Pa]."""
    return min(max(tangent / table.tangent[k, 0], LEAST_SHARE), MOST_SHARE)


@kernel
def update_shares(x, elements, shape, material, table, share):
    """Set the share (m,) of ``elements`` to their tangent modulus over that at rest; return the largest change.

    Bending and twisting inside an element soften with its modulus, as its shape factor does (Algorithm 1). The share
    is held during a descent and updated between descents until it no longer changes, so that the result does not
    depend on the path.
    """
    worst = 0.0
    for e in elements:
        k = material[e]
        if table.law[k] == LINEAR:
            continue
        _, _, _, tangent = strain_state(x, shape, e, table, k)
        value = softened_share(tangent, table, k)
        worst = max(worst, abs(value - share[e]))
        share[e] = value
    return worst
