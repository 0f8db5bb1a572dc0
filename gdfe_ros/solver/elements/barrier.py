# SPDX-License-Identifier: Apache-2.0
"""Compiled fold barrier: an energy of each corner's volume ratio that keeps corners of elements from folding.

The energy of a hexahedron depends on its mean deformation gradient and its hourglass vectors. This energy stays finite
when a corner has no volume left, so that an impact or a pressing obstacle may fold the corner. The barrier adds, for
each corner c of each element,

    E_c = w mu V/8 b(s),   s = J_c / J_0,   b(s) = (1 - s)^3 / s for s < 1, else 0            [J]

with the corner's volume ratio J_c, the threshold J_0, the weight w, the element's shear modulus mu [Pa] and volume V
[m^3]. Its properties are:

1. J_c = r_c a . (b x c) is trilinear in the corner's three edges a, b, c [m]. Here 1 / r_c [m^3] is the undeformed
   triple product. Therefore dJ_c/da = r_c b x c, and cyclically.
2. b, b' and b'' are zero at s = 1. The energy stays twice differentiable, and nothing changes above the threshold.
3. The force that opens the corner grows without bound as s goes to 0: b' = -(1 - s)^2 (1 + 2 s) / s^2.
4. Below s_0 the energy continues as its tangent at s_0, so that it is finite everywhere. A line search whose step is
   too long then has an energy to interpolate. A body that starts with folds is pushed open. (A parabola would push too
   hard: the first step of such a body would run away.)

The corners of a cut cell are the corners of the box that its material fills. Barriers are evaluated only for elements
near folding (see `watch`). Bodies without such elements have no extra cost.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined
from gdfe_ros.mesh.quality import list_ids
from gdfe_ros.mesh.triples import dot

THRESHOLD = 0.2
"""Threshold J_0. A value of 0.3 would act in sound scenes: the least volume ratios of a corner are 0.256 in
tensile_curve and 0.241 in two_material_bar.
"""
WEIGHT = 3.0
"""Weight w. The height of a body after a bounce changes by at most 1.2 % for w from 1 to 10, J_0 from 0.1 to 0.4."""
LINE = 0.1
"""Ratio s_0 = J_c / J_0 below which the energy continues as a straight line."""
NEARLY_FOLDED = 2.0 * THRESHOLD
"""An element is watched if the volume ratio of a corner is below this."""
NONE = np.zeros(0, dtype=np.int32)
"""No watched elements."""


@inlined
def wall(s):
    """Return b(s) and b'(s) for s < 1, with the straight line below `LINE`."""
    t = max(s, LINE)
    rest = 1.0 - t
    value, slope = rest * rest * rest / t, -rest * rest * (1.0 + 2.0 * t) / (t * t)
    value += slope * (s - t)
    return value, slope


@inlined
def corner_room(p, q, r, ratio, scale):
    """Return the largest change [m] of the edges p, q and r of a corner that keeps it above the threshold.

    ``ratio`` is the corner's volume ratio, and ``scale`` [1/m^3] the factor of the edges' triple product in it. With
    lengths A, B and C, the bound is that of `gdfe_ros.solver.elements.response`.
    """
    first, second, third = math.sqrt(dot(p, p)), math.sqrt(dot(q, q)), math.sqrt(dot(r, r))
    share = 3.0 * scale * (first * second + second * third + third * first)
    return min(min(first, second), min(third, (ratio - THRESHOLD) / share))


def flattened(least: NDArray[np.float64]) -> str:
    """Return a message that lists the flat or folded elements; empty if there are none.

    Args:
        least: (m,) least volume ratio at a corner of each element.
    """
    folded, flat = np.flatnonzero(~(least > 0.0)), np.flatnonzero(least < THRESHOLD)
    found = folded if len(folded) else flat[np.argsort(least[flat], kind="stable")]
    if not len(found):
        return ""
    what = "folded or turned inside out" if len(folded) else "pressed flat at a corner"
    return f"elements {what} (least volume ratio {least[found].min():.3g}): {list_ids(found)}"
