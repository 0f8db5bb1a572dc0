# SPDX-License-Identifier: Apache-2.0
"""How far a state is from the equilibrium: preconditioned conjugate gradients on the present tangent.

With the gradient g and the tangent K the Newton step d solves K d = -g. What conjugate gradients leave of it, with the
preconditioner H and the residual r, is (H K)^-1 H r: at most |H r| over the least eigenvalue of H K, for which the
least Ritz value stands.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh_tridiagonal

from gdfe_ros.solver.distance import largest

MOST_PRODUCTS = 60
"""Products of the tangent after which it is said that the distance is not known."""
LEAST_PRODUCTS, STEADY = 3, 0.7
"""Products after which an end is thought of, and the least Ritz value over the one before: while it still falls, softer
motions come to light."""
ROUNDING = 1e-20
"""Share of the first residual's square that is rounding."""
LEFT = 0.3
"""Share of the step, or of the target, that may be left when it counts as known."""
HIDDEN = 0.01
"""Of what a random right-hand side has of one motion, on average: with less of it left none is hidden any more."""

Apply = Callable[[NDArray[np.float64], NDArray[np.float64]], None]
Product = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Estimate(NamedTuple):
    """What conjugate gradients found.

    Attributes:
        step: (3 r,) towards the equilibrium [m]; where the tangent is indefinite, a direction of negative curvature
            that descends.
        distance: largest vertex displacement of it and of what is left [m]; infinite where it is not known.
        known: the step is known well enough for the distance to hold.
        definite: no direction of negative curvature was met.
        products: of the tangent that were needed.
        least: Ritz value that was met.
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
    """Solve K d = -gradient (3 r,) until what is left of d is a small share of it, or of ``target`` [m].

    Args:
        product: multiplies the tangent with a direction.
        gradient: g = dE/du [N].
        preconditioned: H g [m].
        precondition: writes H times its first argument to its second.
        target: distance that matters.
        least: eigenvalue of H K that is known to be there, at most 1.
        left_over: most of g'Hg that may be left, as a share.
        most: products after which it is given up.
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
