# SPDX-License-Identifier: Apache-2.0
"""Solution of linear systems given by matrix-vector products: left-preconditioned GMRES (Saad and Schultz 1986)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from gdfe_ros.errors import GdfeError

ENOUGH = 1e-5
"""Relative residual that is accepted if the tolerance cannot be reached because the products are differences."""
EXHAUSTED = 1e-13
"""Norm of the orthogonal part of a product with a unit vector, below which it is rounding."""
ROUNDING = 1e-6
"""Least size of the solution, over the right-hand side, that the relative residual assumes."""
MOST = 150
"""Limit of products."""

Map = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def solved(product: Map, precondition: Map, right: NDArray[np.float64], *, tolerance: float) -> NDArray[np.float64]:
    """Return x of A x = b.

    Args:
        product: returns A times a vector (k,).
        precondition: returns M^-1 times a vector (k,); the closer M is to A, the fewer products are needed.
        right: b (k,).
        tolerance: norm of the preconditioned residual over the smaller one of the norms of M^-1 b and x.

    Raises:
        GdfeError: A is singular, or nearly so: there is no derivative.
    """
    residual = precondition(right)
    size = float(np.linalg.norm(residual))
    if size == 0.0:
        return np.zeros_like(right)
    basis, rows, turns = [residual / size], np.zeros((MOST + 1, MOST)), np.zeros((MOST, 2))
    goal, best = np.zeros(MOST + 1), np.inf
    goal[0] = size
    for k in range(MOST):
        image = precondition(product(basis[-1]))
        for _ in range(2):  # a single pass leaves rounding, which matters if the matrix is close to the preconditioner
            shares = np.array([float(vector @ image) for vector in basis])
            rows[: k + 1, k] += shares
            for share, vector in zip(shares, basis, strict=True):
                image -= share * vector
        length = rows[k + 1, k] = float(np.linalg.norm(image))
        for i in range(k):  # Givens rotations keep the rows triangular
            _turn(rows[i : i + 2, k], turns[i])
        turns[k] = rows[k : k + 2, k] / max(float(np.hypot(*rows[k : k + 2, k])), 1e-300)
        _turn(rows[k : k + 2, k], turns[k])
        _turn(goal[k : k + 2], turns[k])
        answer = solve_triangular(rows[: k + 1, : k + 1], goal[: k + 1])
        # A stiff constraint makes the right-hand side far larger than the solution, whose accuracy matters.
        left = abs(goal[k + 1]) / min(size, max(float(np.linalg.norm(answer)), ROUNDING * size))
        if left < tolerance or not length > EXHAUSTED or (left < ENOUGH and left > 0.5 * best):
            break
        best = min(best, left)
        basis.append(image / length)
    count = k + 1
    if not left < ENOUGH:
        raise GdfeError(
            f"no derivative exists here, or none is known: the tangent is singular (residual {left:.2g} after {count} "
            "products); remedy: step away from the edge of stability"
        )
    return answer @ np.array(basis[:count])


def _turn(pair: NDArray[np.float64], turn: NDArray[np.float64]) -> None:
    """Rotate two numbers by the angle with the given cosine and sine."""
    cosine, sine = turn
    pair[:] = cosine * pair[0] + sine * pair[1], cosine * pair[1] - sine * pair[0]
