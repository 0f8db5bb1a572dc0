# SPDX-License-Identifier: Apache-2.0
"""Softest direction of a tangent, by the preconditioned Lanczos method.

K is a tangent, and M is a positive definite preconditioner that is given by its inverse. The least eigenvalue of M^-1 K
has the sign of the least eigenvalue of K. The closer M is to K, the fewer products are needed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh_tridiagonal

MOST_PRODUCTS = 80
"""The least eigenvalue counts as unknown after this number of products."""
LEAST_PRODUCTS = 12
"""Least number of products before a Ritz value can count as converged."""
LOOK_BACK, STEADY, FLAT = 4, 0.05, 1e-4
"""The least Ritz value is computed after every `LOOK_BACK` products. It counts as converged if it changed over these by
at most the fraction `STEADY`, or by at most `FLAT`. A value below `FLAT` counts as no curvature.
"""

NOISE = 1e-4
"""The next Lanczos vector counts as noise if its M-norm, divided by the largest diagonal entry, is below this, because
products are differences of gradients.
"""

Apply = Callable[[NDArray[np.float64], NDArray[np.float64]], None]
Product = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Lowest(NamedTuple):
    """Result of the Lanczos method.

    Attributes:
        value: least Ritz value of M^-1 K.
        direction: (3 r,) Ritz vector [m] of this value, with M-norm 1.
        known: whether the value has converged to the least eigenvalue.
        products: number of products with K.
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

    Vectors are not reorthogonalised; the loss of orthogonality only repeats converged values.

    Args:
        product: multiplies the tangent K by a direction (3 r,).
        precondition: writes M^-1 times its first argument to its second.
        load: (3 r,) M times the start vector, which must contain every mode.
        most: limit of products.
        steady: relative change at which the value counts as converged; 0 to make ``most`` products.
    """
    vector, before = np.empty_like(load), np.zeros_like(load)
    precondition(load, vector)
    weight = float(load @ vector)
    vectors = np.empty((most, len(load)), np.float32)  # pages never written use no memory
    diagonal: list[float] = []
    beside: list[float] = []
    value, known, flat = np.inf, not weight > 0.0, FLAT if steady else 0.0
    while weight > 0.0 and len(diagonal) < most:
        scale = 1.0 / np.sqrt(weight)
        vector, load = scale * vector, scale * load
        vectors[len(diagonal)] = vector
        image = product(vector)
        diagonal.append(float(vector @ image))
        if len(diagonal) % LOOK_BACK == 0:
            last, value = value, _least(diagonal, beside)[0]
            known = len(diagonal) >= LEAST_PRODUCTS and last - value <= max(steady * abs(value), flat)
            if known:
                break
        load, before = image - diagonal[-1] * load - (beside[-1] if beside else 0.0) * before, load
        precondition(load, vector)
        weight = float(load @ vector)
        known = not weight > (NOISE * float(np.abs(diagonal).max())) ** 2  # the vectors span the whole Krylov space
        if known:
            break
        beside.append(np.sqrt(weight))
    if not diagonal:
        return Lowest(1.0, np.zeros_like(load), True, 0)
    value, coefficients = _least(diagonal, beside[: len(diagonal) - 1])
    return Lowest(value, coefficients @ vectors[: len(diagonal)], known, len(diagonal))


def _least(diagonal: list[float], beside: list[float]) -> tuple[float, NDArray[np.float64]]:
    """Return the least eigenvalue of a symmetric tridiagonal matrix, and its vector."""
    values, vectors = eigh_tridiagonal(np.array(diagonal), np.array(beside), select="i", select_range=(0, 0))
    return float(values[0]), vectors[:, 0]
