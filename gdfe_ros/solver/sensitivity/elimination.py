# SPDX-License-Identifier: Apache-2.0
"""Block elimination of a few multipliers from the linearised solve; each column then needs fewer products."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, lu_factor, lu_solve

Array = NDArray[np.float64]
MOST = 12
"""Largest number of multipliers that are eliminated; each costs one solve with the factor per state."""


class SchurComplement:
    """The Schur complement S = D + C K^-1 B of the system K dx + B dm = f, -C dx + D dm = g.

    Args:
        product: function that returns the left-hand sides (r + k,) of both equations for a vector (r + k,) of dx, then
            dm.
        solve: function that returns K^-1 f for forces f (r,).
        rows: number r of unknowns dx.
        count: number k of multipliers dm.

    Raises:
        LinAlgError: S is singular.
    """

    def __init__(
        self, product: Callable[[Array], Array], solve: Callable[[Array], Array], rows: int, count: int
    ) -> None:
        self._product, self._solve, self._rows = product, solve, rows
        self._pushed, complement = np.empty((rows, count)), np.empty((count, count))
        for j in range(count):
            one = np.zeros(rows + count)
            one[rows + j] = 1.0
            self._pushed[:, j] = solve(product(one)[:rows])
            one[:rows] = -self._pushed[:, j]
            complement[:, j] = product(one)[rows:]
        if not np.isfinite(complement).all():
            raise LinAlgError("the complement is not finite")
        self._factor = lu_factor(complement, check_finite=False)
        if not np.abs(np.diag(self._factor[0])).min() > 1e-14 * np.abs(complement).max():
            raise LinAlgError("the complement is singular")

    def __call__(self, vector: Array) -> Array:
        """Return dx, then dm, (r + k,) for the right-hand sides ``vector`` (r + k,): f, then g."""
        rows = self._rows
        alone = np.zeros_like(vector)
        alone[:rows] = self._solve(vector[:rows])
        multipliers = lu_solve(self._factor, vector[rows:] - self._product(alone)[rows:], check_finite=False)
        return np.concatenate([alone[:rows] - self._pushed @ multipliers, multipliers])
