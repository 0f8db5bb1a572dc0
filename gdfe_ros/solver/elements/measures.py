# SPDX-License-Identifier: Apache-2.0
"""Compiled measures of an element (mean gradient, volumes, strain, moduli), and the updates that use them."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.materials.material import Law
from gdfe_ros.materials.stress import curve_state
from gdfe_ros.materials.table import BULK, CARRIED, PENALTY, POISSON, SHEAR
from gdfe_ros.materials.tensor import NEWTON_STEPS, cofactor, determinant, squared_norm, stretch_sum
from gdfe_ros.solver.elements.barrier import corner_ratios_at
from gdfe_ros.solver.elements.cell_type import volume_ratio
from gdfe_ros.solver.elements.corners import mean_gradient

LEAST_SCALE, MOST_SCALE = 0.25, 4.0
"""Bounds of the hourglass stiffness divided by its initial value. The lower bound prevents hourglassing of elements
that soften much. With the upper bound, the constant matrix stays a good preconditioner for elements that stiffen much.
"""
LEAST_CURVE_SCALE = 0.8
"""Lower bound for the law of measured curves, because its tangent modulus decreases most. In the scene tensile_curve at
100 % elongation, corners fold with the bound 0.25 (least volume ratio -1.56 after 999 iterations) and with 0.5 (-1.05).
With 0.8 no corner folds (0.26 after 211 iterations).
"""


@kernel
def corner_ratios(x, shape):
    """Return the least volume ratio (m,) at a corner of each element at ``x`` (n, 3) [m]; NaN if one ratio is NaN."""
    ratios, points = np.empty(len(shape.cells)), np.empty((shape.cells.shape[1], 3))
    for e in range(len(ratios)):
        ratios[e] = corner_ratios_at(x, shape, e, points)[0]
    return ratios


@kernel
def least_volume_ratio(x, shape):
    """Return the least volume ratio at any corner of any element at ``x`` (n, 3) [m]; NaN if any ratio is NaN."""
    return corner_ratios(x, shape).min()


@internal
def volume_at(total, table, k):
    """Return the volume ratio J* with U'(J*) = ``total`` [Pa] for the volume energy U of material ``k``."""
    bulk = table.parameters[k, BULK]
    if table.law[k] != Law.NEO_HOOKEAN or bulk == math.inf:
        return 1.0 + total / bulk
    lame = bulk - 2.0 / 3.0 * table.parameters[k, SHEAR]
    slope = min(total / lame, 0.3)
    # From below the root Newton's method converges monotonically: log(j) - slope j is concave.
    j = 1.0 + slope if slope > -0.9 else 1.0 / (1.0 - slope)
    for _ in range(NEWTON_STEPS):  # three to five usually suffice
        step = (math.log(j) - slope * j) / (1.0 / j - slope)
        j = max(j - step, 0.1 * j)
        if abs(step) < 1e-15:
            break
    return j


@kernel
def update_pressures(x, elements, shape, material, table, pressure):
    """Replace the pressures p_e of ``elements`` by p - kappa (J* - 1); return the largest and the mean |J - J*|.

    Here p = p_e + kappa (J - 1), and J* is the volume ratio with U'(J*) = p. The mean is weighted by volume.
    """
    worst, mean, volume = 0.0, 0.0, 0.0
    for e in elements:
        k = material[e]
        if table.parameters[k, CARRIED] == 0.0:
            continue
        kappa = table.parameters[k, PENALTY]
        j = volume_ratio(x, shape, e)
        total = pressure[e] + kappa * (j - 1.0)
        target = volume_at(total, table, k)
        worst = max(worst, abs(j - target))
        mean += shape.volume[e] * abs(j - target)
        volume += shape.volume[e]
        pressure[e] = total - kappa * (target - 1.0)
    return worst, mean / max(volume, 1e-300)


@inlined
def equivalent_strain(f, c, j, table, k):
    """Return the equivalent strain (Eq. 5 of the paper) with Poisson's ratio 0.5, or the law's own if linear."""
    first = squared_norm(f)
    s = stretch_sum(first, squared_norm(c), j)
    nu = table.parameters[k, POISSON] if table.law[k] == Law.LINEAR else 0.5
    return math.sqrt(max(1.5 * (first - s * s / 3.0), 0.0)) / (1.0 + nu)


@inlined
def strain_state(x, shape, e, table, k):
    """Return equivalent strain, volume ratio J, secant and tangent modulus [Pa] of element ``e``, of material ``k``."""
    f = mean_gradient(x, shape, e)
    c = cofactor(f)
    strain = equivalent_strain(f, c, determinant(f, c), table, k)
    _, secant, tangent = curve_state(strain, table, k)
    return strain, volume_ratio(x, shape, e), secant, tangent


@inlined
def softened_scale(tangent, table, k):
    """Return an element's scale: its ``tangent`` modulus [Pa] divided by the initial modulus, within the bounds."""
    least = LEAST_CURVE_SCALE if table.law[k] == Law.CURVE else LEAST_SCALE
    return min(max(tangent / table.tangent[k, 0], least), MOST_SCALE)


@kernel
def update_hourglass_scales(x, elements, shape, material, table, scale):
    """Set the scale (m,) of ``elements`` to their `softened_scale`; return the largest change.

    The hourglass stiffness, for bending and torsion inside an element, changes with the element's modulus, like the
    shape factor in Algorithm 1 of the paper. The scale is constant during a minimisation. It is updated between
    minimisations until it no longer changes, so that the result does not depend on the load path.
    """
    worst = 0.0
    for e in elements:
        k = material[e]
        if table.law[k] == Law.LINEAR:
            continue
        _, _, _, tangent = strain_state(x, shape, e, table, k)
        value = softened_scale(tangent, table, k)
        worst = max(worst, abs(value - scale[e]))
        scale[e] = value
    return worst
