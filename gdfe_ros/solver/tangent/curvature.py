# SPDX-License-Identifier: Apache-2.0
"""The direction in which a tangent is softest, or curves down: Lanczos with a preconditioner's factor.

With a tangent K and a positive definite M, whose inverse is applied, the least eigenvalue of M^-1 K has the sign of the
least eigenvalue of K: M need only be near enough for few products.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh_tridiagonal

from gdfe_ros.solver.tangent.estimate import Apply, Product

MOST_PRODUCTS = 80
"""Products after which the least eigenvalue is not known."""
LEAST_PRODUCTS = 10
"""Products before which no Ritz value counts as steady."""
LOOK_BACK, STEADY, FLAT = 4, 0.05, 1e-4
"""Products in which the least Ritz value changes by no more than this share of itself, or no more than what counts as
no curvature at all, when it is steady."""

NOISE = 1e-4
"""Share of a product below which what is left of it is noise: it is a difference of gradients."""


class Lowest(NamedTuple):
    """What Lanczos found.

    Attributes:
        value: least Ritz value of M^-1 K.
        direction: (3 r,) its vector [m], with M-norm 1.
        known: the value is steady: it is near the least eigenvalue.
        products: of K that were needed.
    """

    value: float
    direction: NDArray[np.float64]
    known: bool
    products: int


def lowest(
    product: Product,
    precondition: Apply,
    load: NDArray[np.float64],
    *,
    most: int = MOST_PRODUCTS,
    steady: float = STEADY,
) -> Lowest:
    """Return the least Ritz value of M^-1 K and its vector.

    Vectors are not made orthogonal again: what that repeats are values that are steady already.

    Args:
        product: multiplies the tangent K with a direction (3 r,).
        precondition: writes M^-1 times its first argument to its second.
        load: (3 r,) M times the vector to begin with; it has a share of every motion.
        most: products at most.
        steady: share of itself by which the value may still change at the end; 0 for as many products as there may be.
    """
    vector, before = np.empty_like(load), np.zeros_like(load)
    precondition(load, vector)
    weight = float(load @ vector)
    vectors = np.empty((most, len(load)), np.float32)  # what is not written takes no memory
    diagonal: list[float] = []
    beside: list[float] = []
    values: list[float] = []
    found: tuple[float, NDArray[np.float64]] | None = None
    known, flat = not weight > 0.0, FLAT if steady else 0.0
    while weight > 0.0 and len(diagonal) < most:
        scale = 1.0 / np.sqrt(weight)
        vector, load = scale * vector, scale * load
        vectors[len(diagonal)] = vector
        image = product(vector)
        diagonal.append(float(vector @ image))
        if len(diagonal) >= LEAST_PRODUCTS - LOOK_BACK:
            found = _least(diagonal, beside)
            values.append(found[0])
        known = len(values) > LOOK_BACK and (values[-1 - LOOK_BACK] - values[-1] <= max(steady * abs(values[-1]), flat))
        if known:
            break
        load, before = image - diagonal[-1] * load - (beside[-1] if beside else 0.0) * before, load
        precondition(load, vector)
        weight = float(load @ vector)
        known = not weight > (NOISE * float(np.abs(diagonal).max())) ** 2  # the vectors span all that has a share
        if known:
            break
        beside.append(np.sqrt(weight))
    if not diagonal:
        return Lowest(1.0, np.zeros_like(load), True, 0)
    value, coefficients = found or _least(diagonal, beside[: len(diagonal) - 1])
    return Lowest(value, coefficients @ vectors[: len(diagonal)], known, len(diagonal))


def _least(diagonal: list[float], beside: list[float]) -> tuple[float, NDArray[np.float64]]:
    """Return the least eigenvalue of a symmetric tridiagonal matrix, and its vector."""
    values, vectors = eigh_tridiagonal(np.array(diagonal), np.array(beside), select="i", select_range=(0, 0))
    return float(values[0]), vectors[:, 0]
