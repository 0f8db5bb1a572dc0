# SPDX-License-Identifier: Apache-2.0
"""How much softer than its constant matrix a body is in its softest motion: slender, thin, of hard and soft parts."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh_tridiagonal

from gdfe_ros.solver.tangent.estimate import Apply, Product

PRODUCTS = 40
"""Lanczos steps. From a smooth start they find the softest motion of a slender body to a factor of ten, which is enough
to tell it from a stocky one; docs/theory/solve.md has the figures."""
DEGREE = 3
"""Of the polynomials of the start, whose shapes are those of the softest motions."""


def softness(product: Product, precondition: Apply, start: NDArray[np.float64], products: int = PRODUCTS) -> float:
    """Return the least Ritz value of A^-1 K: the stiffness of the softest motion over that of the constant matrix.

    Args:
        product: multiplies the tangent K with a direction (3 r,).
        precondition: writes A^-1 times its first argument to its second.
        start: (3 r,) A times a field that holds the softest motions.
        products: Lanczos steps at most.
    """
    residual, z = start, np.zeros_like(start)
    precondition(residual, z)
    direction, weight = z.copy(), float(residual @ z)
    diagonal: list[float] = []
    beside: list[float] = []
    length = ratio = 0.0
    least = rounding = np.finfo(float).eps * weight
    while len(diagonal) < products and weight > rounding:
        image = product(direction)
        curvature = float(direction @ image)
        if not curvature > 0.0:
            return 0.0
        diagonal.append(curvature / weight + (ratio / length if length else 0.0))
        least = float(eigvalsh_tridiagonal(np.array(diagonal), np.array(beside))[0])
        length = weight / curvature
        residual = residual - length * image
        precondition(residual, z)
        before, weight = weight, float(residual @ z)
        ratio = weight / before
        beside.append(np.sqrt(max(ratio, 0.0)) / length)
        direction = z + ratio * direction
    return least if diagonal else 1.0


def smooth_field(points: NDArray[np.float64], pieces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return a field (n, 3) over ``points`` (n, 3) [m] in which every polynomial up to `DEGREE` has its share.

    Of each of the ``pieces`` (n,), numbered from 0: over all of two that are far apart, polynomials hardly bend either.
    """
    field = np.empty_like(points)
    for piece in range(int(pieces.max(initial=-1)) + 1):
        own = pieces == piece
        field[own] = _polynomials(points[own])
    return field


def _polynomials(points: NDArray[np.float64]) -> NDArray[np.float64]:
    scaled = (points - points.mean(axis=0)) / max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
    columns = [np.ones(len(points))]
    for degree in range(1, DEGREE + 1):
        columns += [scaled[:, list(axes)].prod(axis=1) for axes in combinations_with_replacement(range(3), degree)]
    return np.stack(columns, axis=1) @ np.random.default_rng(0).standard_normal((len(columns), 3))
