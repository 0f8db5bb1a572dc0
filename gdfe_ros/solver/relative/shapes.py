# SPDX-License-Identifier: Apache-2.0
"""Element shapes of the ``relative`` policy: desired shapes (Eqs. 9 and 10) and captured shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.materials.tensor import rotation
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.elements.cell_kernels import mean_gradient

LEAST_VOLUME = 1e-3
"""Lower bound of the volume ratio from which the scale of V^V is computed; without this bound, the scale could become
infinite. For an inverted element, the absolute value of the ratio is used.
"""


def blend(before: NDArray[np.float64], now: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return alpha = eps_p / eps_c of Eq. 9, or its inverse for a strain that has decreased.

    The paper considers loading, where the ratio is at most 1. On unloading, alpha must vanish with the strain.
    Otherwise the captured shape would remain the desired one, and the element would not return to its rest shape.
    """
    most = np.maximum(before, now)
    return np.minimum(before, now) / np.maximum(most, 1e-12)


@internal
def _frame(x, shape, e):
    """Return the proper rotation of an element and the factor that scales it to its rest volume."""
    r, _, j = rotation(mean_gradient(x, shape, e))
    return r, max(abs(j), LEAST_VOLUME) ** (-1.0 / 3.0)


@internal
def _centre(x, cells, e, centre):
    """Write the mean position of the corners of element ``e`` to ``centre`` (3,)."""
    centre[:] = 0.0
    for a in range(8):
        for i in range(3):
            centre[i] += 0.125 * x[cells[e, a], i]


@kernel
def shape_differences(x, shape, rest, captured, alpha, omega, difference):
    """Write Omega_e (N V - V^B) (m, 8, 3), with rest volume Omega_e and desired shape V^B of Eqs. 9 and 10."""
    centre = np.empty(3)
    for e in range(len(shape.cells)):
        r, scale = _frame(x, shape, e)
        _centre(x, shape.cells, e, centre)
        for a in range(8):
            p0 = (1.0 - alpha[e]) * rest[e, a, 0] + alpha[e] * captured[e, a, 0]
            p1 = (1.0 - alpha[e]) * rest[e, a, 1] + alpha[e] * captured[e, a, 1]
            p2 = (1.0 - alpha[e]) * rest[e, a, 2] + alpha[e] * captured[e, a, 2]
            for i in range(3):
                current = x[shape.cells[e, a], i] - centre[i]
                previous = r[3 * i] * p0 + r[3 * i + 1] * p1 + r[3 * i + 2] * p2
                desired = omega[e] * previous + (1.0 - omega[e]) * scale * current
                difference[e, a, i] = shape.volume[e] * (current - desired)


@kernel
def capture_shapes(x, shape: ShapeOperators, captured):
    """Write R^T V^V (m, 8, 3) [m], the shapes of rest volume in the elements' own frames, to ``captured``."""
    centre = np.empty(3)
    for e in range(len(shape.cells)):
        r, scale = _frame(x, shape, e)
        _centre(x, shape.cells, e, centre)
        for a in range(8):
            v = shape.cells[e, a]
            y0, y1, y2 = x[v, 0] - centre[0], x[v, 1] - centre[1], x[v, 2] - centre[2]
            for i in range(3):
                captured[e, a, i] = scale * (r[i] * y0 + r[3 + i] * y1 + r[6 + i] * y2)
