# SPDX-License-Identifier: Apache-2.0
"""Linear systems whose matrix is known by its products: GMRES (Saad and Schultz 1986), preconditioned from the left."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import GdfeError

TOLERANCE = 1e-9
"""Of the preconditioned residual, over that of the right-hand side."""
ENOUGH = 1e-6
"""The same that is accepted where products are differences, and less cannot be reached."""
MOST = 150
"""Products at most."""

Map = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def solved(product: Map, precondition: Map, right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x of A x = b.

    Args:
        product: returns A times a vector (k,).
        precondition: returns M^-1 times a vector (k,); the nearer M is to A, the fewer products are needed.
        right: b (k,).

    Raises:
        GdfeError: A is singular, or nearly so: there is no derivative.
    """
    residual = precondition(right)
    size = float(np.linalg.norm(residual))
    if size == 0.0:
        return np.zeros_like(right)
    basis, rows = [residual / size], np.zeros((MOST + 1, MOST))
    best, answer = np.inf, np.zeros(0)
    for count in range(1, MOST + 1):
        image = precondition(product(basis[-1]))
        for _ in range(2):  # once leaves rounding, which counts where the matrix is nearly the preconditioner
            for i, vector in enumerate(basis):
                share = float(vector @ image)
                rows[i, count - 1] += share
                image = image - share * vector
        length = float(np.linalg.norm(image))
        rows[count, count - 1] = length
        goal = np.zeros(count + 1)
        goal[0] = size
        answer = np.linalg.lstsq(rows[: count + 1, :count], goal, rcond=None)[0]
        left = float(np.linalg.norm(rows[: count + 1, :count] @ answer - goal)) / size
        if left < TOLERANCE or not length > TOLERANCE * size or (left < ENOUGH and left > 0.5 * best):
            break
        best = min(best, left)
        basis.append(image / length)
    if not left < ENOUGH:
        raise GdfeError(
            f"no derivative exists here, or none is known: the tangent is singular (residual {left:.2g} after {count} "
            "products); remedy: step away from the edge of stability"
        )
    return answer @ np.array(basis[: len(answer)])
