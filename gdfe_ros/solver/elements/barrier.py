# SPDX-License-Identifier: Apache-2.0
"""Compiled fold barrier: an energy of each corner's volume ratio that keeps corners of elements from folding.

A hexahedron's energies are those of its mean deformation gradient and its hourglass vectors. Both stay finite when a
corner has no volume left, so that a blow or a press may fold the corner. The barrier adds, for each corner c of each
element,

    E_c = w mu V/8 b(s),   s = J_c / J_0,   b(s) = (1 - s)^3 / s for s < 1, else 0            [J]

with the corner's volume ratio J_c, the element's shear modulus mu [Pa] and volume V [m^3]. Its properties are:

1. J_c = r_c a . (b x c) is trilinear in the corner's three edges a, b, c [m]; 1 / r_c [m^3] is the undeformed triple
product. Therefore dJ_c/da = r_c b x c, and cyclically. 2. b, b' and b'' are zero at s = 1. The energy stays twice
differentiable, and nothing changes above the threshold. 3. b' = -(1 - s)^2 (1 + 2 s) / s^2 pushes the corner open
without bound as s goes to 0. 4. Below s_0 the energy continues as its tangent at s_0, so that it is finite everywhere.
A line search that steps too far then finds an energy to interpolate. A body that starts with folds is pushed open. (A
parabola would push too hard: the first step of such a body would run away.)

The corners of a cut cell are those of the box that its material fills. Barriers are evaluated only for elements near
folding (see `watch`); bodies without such elements pay nothing.
"""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import inlined

THRESHOLD = 0.2
"""J_0. A value of 0.3 would act in sound scenes: least corners are 0.256 in tensile_curve and 0.241 in
two_material_bar.
"""
WEIGHT = 3.0
"""w. The height after a bounce changes by at most 1.2 % for w from 1 to 10 and J_0 from 0.1 to 0.4."""
LINE = 0.1
"""s_0."""
NEARLY_FOLDED = 0.4
"""An element is watched if the volume ratio of a corner is below this: twice the barriers' threshold."""
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
