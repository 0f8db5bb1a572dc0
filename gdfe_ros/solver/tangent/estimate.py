# SPDX-License-Identifier: Apache-2.0
"""Distance of a state to the equilibrium, by preconditioned conjugate gradients with the present tangent.

With the gradient g and the tangent K the Newton step d solves K d = -g. The part that conjugate gradients leave, with
the preconditioner H and the residual r, is (H K)^-1 H r: at most |H r| over the least eigenvalue of H K, which the
least Ritz value estimates.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh_tridiagonal

from gdfe_ros.solver.distance import largest

MOST_PRODUCTS = 60
"""Products of the tangent after which the distance counts as unknown."""
LEAST_PRODUCTS, STEADY = 3, 0.7
"""Least number of products, and least ratio of the last two least Ritz values at the end: while the value falls faster,
softer modes are still being found."""
ROUNDING = 1e-20
"""Share of the first residual's square that is rounding."""
LEFT = 0.3
"""Largest remainder, over the step or the target, of a step that counts as known."""
HIDDEN = 0.01
"""Remainder of a random right-hand side, over its average component along one mode, below which no mode is hidden."""

Apply = Callable[[NDArray[np.float64], NDArray[np.float64]], None]
Product = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Estimate(NamedTuple):
    """Result of conjugate gradients.

    Attributes:
        step: (3 r,) towards the equilibrium [m]; for an indefinite tangent, a descent direction of negative curvature.
        distance: largest vertex displacement of the step plus its remainder [m]; infinite if it is unknown.
        known: whether the step is accurate enough for the distance.
        definite: whether no direction of negative curvature was found.
        products: number of products with the tangent.
        least: least Ritz value found.
    """

    step: NDArray[np.float64]
    distance: float
    known: bool
    definite: bool
    products: int
    least: float


def estimate(
    product: Product,
    gradient: NDArray[np.float64],
    preconditioned: NDArray[np.float64],
    precondition: Apply,
    target: float,
    *,
    least: float = 1.0,
    left_over: float = np.inf,
    most: int = MOST_PRODUCTS,
) -> Estimate:
    """Solve K d = -gradient (3 r,) until the remainder of d is a small share of it, or of ``target`` [m].

    Args:
        product: multiplies the tangent by a direction.
        gradient: g = dE/du [N].
        preconditioned: H g [m].
        precondition: writes H times its first argument to its second.
        target: distance that matters [m].
        least: known upper bound of the least eigenvalue of H K, at most 1.
        left_over: largest remaining share of g'Hg.
        most: limit of products.
    """
    residual, step, z = -gradient, np.zeros_like(gradient), -preconditioned
    direction, weight = z.copy(), float(residual @ z)
    diagonal: list[float] = []
    beside: list[float] = []
    length = ratio = 0.0
    first = weight
    if not weight > 0.0:
        return Estimate(step, 0.0, True, True, 0, least)
    for count in range(1, most + 1):
        image = product(direction)
        curvature = float(direction @ image)
        if not curvature > 0.0:
            return Estimate(direction, np.inf, False, False, count, least)
        diagonal.append(curvature / weight + (ratio / length if length else 0.0))
        length = weight / curvature
        step += length * direction
        residual -= length * image
        precondition(residual, z)
        before, weight = weight, float(residual @ z)
        earlier, least = least, min(least, float(eigvalsh_tridiagonal(np.array(diagonal), np.array(beside))[0]))
        left, far = largest(z) / least, largest(step)
        steady = count >= LEAST_PRODUCTS and least >= STEADY * earlier
        told = steady and left <= LEFT * max(far, target) and weight <= left_over * first
        if told or not weight > ROUNDING * first:
            return Estimate(step, far + left, True, True, count, least)
        ratio = weight / before
        beside.append(np.sqrt(ratio) / length)
        direction = z + ratio * direction
    return Estimate(step, np.inf, False, True, most, least)
