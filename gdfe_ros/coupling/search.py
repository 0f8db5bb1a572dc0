# SPDX-License-Identifier: Apache-2.0
"""Search for the positions at which joints are in balance, with few evaluations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
ENOUGH = 0.02
"""A step of the search ends if it reduces the gap along its direction to at most this fraction."""


class BalanceSearch:
    """Search for a zero of ``gap``, the gradient of a convex function that has kinks where contacts close or open.

    Steps are those of the BFGS method. Across a kink, a step may be many times too long. If the gap along a step has
    the other sign and is not small enough, the step is therefore shortened by the Illinois variant of false position
    (Dowell and Jarratt, BIT 11, 1971).

    Args:
        derivative: (y, y) symmetric part of the derivative of the gap that is known, a lower bound of the whole.
    """

    def __init__(self, derivative: Vector) -> None:
        self._scale = np.sqrt(np.diag(derivative))
        self._least = derivative / np.outer(self._scale, self._scale)
        self._matrix = self._least.copy()
        self._base: tuple[Vector, Vector] | None = None

    def bound(self, gap: Vector) -> Vector:
        """Return a correction (y,) at least as long as the distance to the zero, from the known derivative alone."""
        return -np.linalg.solve(self._least, gap / self._scale) / self._scale

    def next(self, q: Vector, gap: Vector, *, longest: float = np.inf) -> Vector:
        """Return the next positions (y,) to evaluate.

        Args:
            q: positions (y,) of the last evaluation.
            gap: (y,) gap there.
            longest: largest fraction of a new BFGS step that may be made.
        """
        here, rest = q * self._scale, gap / self._scale
        if self._base is None or self._ends(rest):
            self._restart(here, rest, longest)
        else:
            self._shorten()
        return (self._base[0] + self._length * self._direction) / self._scale

    def _ends(self, rest: Vector) -> bool:
        """Store the gap along the direction; return whether it is small enough, or the step is only too short."""
        slope, enough = float(rest @ self._direction), ENOUGH * abs(self._first)
        if abs(slope) <= enough or (slope < 0.0 and self._high is None):
            return True
        if slope > 0.0:
            if self._side > 0:
                self._low = self._low[0], 0.5 * self._low[1]
            self._high, self._side = (self._length, slope), 1
        else:
            if self._side < 0:
                self._high = self._high[0], 0.5 * self._high[1]
            self._low, self._side = (self._length, slope), -1
        return False

    def _restart(self, here: Vector, rest: Vector, longest: float) -> None:
        """Update the matrix with the last step, and start the next step."""
        if self._base is not None:
            step, change = here - self._base[0], rest - self._base[1]
            if step @ change > 0.0:
                image = self._matrix @ step
                self._matrix += np.outer(change, change) / (step @ change) - np.outer(image, image) / (step @ image)
        self._base, self._direction = (here, rest), -np.linalg.solve(self._matrix, rest)
        self._first = float(rest @ self._direction)
        self._length, self._side = min(1.0, longest), 0
        self._low, self._high = (0.0, self._first), None

    def _shorten(self) -> None:
        """Set the length of the step to the zero of the line through both ends of the bracket."""
        (a, below), (b, above) = self._low, self._high
        self._length = a - below * (b - a) / (above - below)
