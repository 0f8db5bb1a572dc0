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
    the other sign and is not small enough, the step is therefore shortened: to the zero of the line through the last
    two points on the same side of the zero, or else through the two ends of the bracket.

    Args:
        derivative: (y, y) symmetric part of the derivative of the gap that is known, a lower bound of the whole.
    """

    def __init__(self, derivative: Vector) -> None:
        self._scale = np.sqrt(np.diag(derivative))
        self._least = derivative / np.outer(self._scale, self._scale)
        self._matrix = self._least.copy()
        self._base: tuple[Vector, Vector] | None = None
        self._last: tuple[Vector, Vector] | None = None

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
        self._last = here, rest
        return (self._base[0] + self._length * self._direction) / self._scale

    def _ends(self, rest: Vector) -> bool:
        """Store the gap along the direction; return whether it is small enough, or the step is only too short."""
        slope, enough = float(rest @ self._direction), ENOUGH * abs(self._below[0][1])
        if abs(slope) <= enough or (slope < 0.0 and not self._above):
            return True
        self._side = self._above if slope > 0.0 else self._below
        self._side.append((self._length, slope))
        return False

    def _restart(self, here: Vector, rest: Vector, longest: float) -> None:
        """Update the matrix with the difference to the last evaluation, and start the next step."""
        if self._last is not None:
            step, change = here - self._last[0], rest - self._last[1]
            if step @ change > 0.0:
                image = self._matrix @ step
                self._matrix += np.outer(change, change) / (step @ change) - np.outer(image, image) / (step @ image)
        self._base, self._direction = (here, rest), -np.linalg.solve(self._matrix, rest)
        self._length, self._width = min(1.0, longest), np.inf
        self._below, self._above = [(0.0, float(rest @ self._direction))], []

    def _shorten(self) -> None:
        """Set the length of the step to a zero of a line, or to the middle if the bracket does not shrink by half."""
        low, high = self._below[-1], self._above[-1]
        width, narrow = self._width, high[0] - low[0]
        self._width = narrow
        length = 0.5 * (low[0] + high[0])
        if narrow <= 0.5 * width:
            length = _zero(low, high)
            if len(self._side) > 1:
                own = _zero(*self._side[-2:])
                length = own if low[0] < own < high[0] else length
        self._length = length


def _zero(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the zero of the line through two points; NaN if the line is level."""
    (a, first), (b, second) = one, other
    return a - first * (b - a) / (second - first) if second != first else np.nan
