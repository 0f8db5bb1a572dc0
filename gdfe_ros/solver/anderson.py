# SPDX-License-Identifier: Apache-2.0
"""Anderson acceleration of a fixed-point iteration (Anderson 1965, type II), with restarts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class Anderson:
    """Anderson acceleration of the iteration x <- x + f(x), from the last few pairs (x, f).

    Args:
        growth: largest factor by which the norm of the residual may grow without dropping the history. A large one
            suits iterations that diverge by themselves, which only the history makes converge.
    """

    MEMORY = 6
    """Number of differences between successive iterates that the acceleration uses."""
    GROWTH = 2.0
    """If the norm of the residual grows by more than this factor, the history is dropped and a plain iteration follows.
    """

    def __init__(self, growth: float = GROWTH) -> None:
        self._growth = growth
        self._iterates: list[NDArray[np.float64]] = []
        self._residuals: list[NDArray[np.float64]] = []

    def next(self, x: NDArray[np.float64], f: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the iterate that follows ``x`` with the residual ``f``; all are flat (k,).

        If the norm of the residual has grown by more than ``growth``, the history is dropped and x + f is returned.
        """
        if self._residuals and np.linalg.norm(f) > self._growth * np.linalg.norm(self._residuals[-1]):
            self._iterates.clear()
            self._residuals.clear()
        self._iterates.append(x.copy())
        self._residuals.append(f.copy())
        del self._iterates[: -self.MEMORY - 1], self._residuals[: -self.MEMORY - 1]
        if len(self._residuals) == 1:
            return x + f
        changes = np.diff(np.array(self._residuals), axis=0)
        moves = np.diff(np.array(self._iterates), axis=0)
        # Solve the small normal equations: an SVD of the tall system costs more than the rest of the iteration.
        weights = np.linalg.lstsq(changes @ changes.T, changes @ f, rcond=1e-14)[0]
        return x + f - weights @ (moves + changes)
