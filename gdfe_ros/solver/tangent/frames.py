# SPDX-License-Identifier: Apache-2.0
"""Rotations of a body's vertices since its tangent was taken.

A slender body that bends turns its stiff directions into its soft ones: after a few degrees a kept tangent K0 is a
hundred times too soft there. R K0 R^T with the rotation R of each vertex follows such a motion, as the local rotation
fit of the paper does for the elements.
"""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.materials.tensor import (
    cofactor,
    determinant,
    rotation_from_stretch_sum,
    squared_norm,
    stretch_sum,
)
from gdfe_ros.solver.elements.measures import mean_gradient

UNIQUE = 0.05
"""Margin of the rotation's uniqueness below which an element, or a vertex, counts as not rotated; it is 8 / 27^(1/2) at
rest."""

LEAST_TURN = 3e-3
"""Largest rotation [rad] of a vertex below which none counts as rotated: where stiffnesses differ by ten decades, small
differences of rotations would do more harm than good."""


@inlined
def rotation(f):
    """Return the rotation of a deformation gradient, and whether it is unique."""
    c = cofactor(f)
    first, j = squared_norm(f), determinant(f, c)
    s = stretch_sum(first, squared_norm(c), j)
    r, margin = rotation_from_stretch_sum(f, c, first, s, j)
    return r, margin > UNIQUE


@kernel
def vertex_rotations(x, before, shape, free, held, sums, out):
    """Write the rotations (f, 9) of the ``free`` vertices from ``before`` to ``x`` (n, 3) [m]: means of the elements'.

    A body that is not ``held`` has one rotation: with several, R K0 R^T would not keep its momentum. ``sums`` (n, 9) is
    scratch.
    """
    sums[...] = 0.0
    for e in range(len(shape.cells)):
        f0 = mean_gradient(before, shape, e)
        f, c = mean_gradient(x, shape, e), cofactor(f0)
        j = determinant(f0, c)
        # F F0^-1 = F cof(F0)^T / J0; the factor 1 / J0 does not change the rotation
        if not j > 0.0:
            continue
        a = (
            f[0] * c[0] + f[1] * c[1] + f[2] * c[2], f[0] * c[3] + f[1] * c[4] + f[2] * c[5],
            f[0] * c[6] + f[1] * c[7] + f[2] * c[8], f[3] * c[0] + f[4] * c[1] + f[5] * c[2],
            f[3] * c[3] + f[4] * c[4] + f[5] * c[5], f[3] * c[6] + f[4] * c[7] + f[5] * c[8],
            f[6] * c[0] + f[7] * c[1] + f[8] * c[2], f[6] * c[3] + f[7] * c[4] + f[8] * c[5],
            f[6] * c[6] + f[7] * c[7] + f[8] * c[8],
        )  # fmt: skip
        r, unique = rotation(a)
        if unique:
            for corner in range(8):
                v = shape.cells[e, corner]
                for i in range(9):
                    sums[v, i] += r[i]
    most = 0.0
    if not held:
        for i in range(9):
            sums[:, i] = sums[:, i].sum()
    for i in range(len(free)):
        m = sums[free[i]]
        r, unique = rotation((m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]))
        for k in range(9):
            out[i, k] = r[k] if unique else (1.0 if k % 4 == 0 else 0.0)
        most = max(most, 3.0 - out[i, 0] - out[i, 4] - out[i, 8])
    if most < LEAST_TURN * LEAST_TURN:
        for i in range(len(free)):
            for k in range(9):
                out[i, k] = 1.0 if k % 4 == 0 else 0.0


def unrotated(count: int) -> np.ndarray:
    """Return the rotations (f, 9) of vertices that have not turned."""
    return np.tile(np.eye(3).ravel(), (count, 1))
