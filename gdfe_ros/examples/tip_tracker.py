# SPDX-License-Identifier: Apache-2.0
"""A controller that moves a tip along a path: resolved-rate control with a Jacobian that it keeps up to date."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import lsq_linear

_LEAST = 1e-3
"""Weight of the change's size against the distance."""
_TINY = 1e-12
"""Half the width of a range that is used up: the least-squares solver wants one above zero."""


class TipTracker:
    """Finds commands for actuators that bring a tip to its goals. No ROS in here.

    Each command changes by ``gain`` times the least change of commands that makes up for the distance to the goal, by
    the Jacobian. Broyden's update corrects this after every step by what the last change really did, so that it is
    asked for once only.

    Args:
        jacobian: (axes, actuators) d position / d command at the start.
        command: (actuators,) at the start.
        low: (actuators,) least commands.
        high: (actuators,) largest commands.
        axes: which of x, y, z are controlled.
        gain: share of the distance that one command makes up for, in (0, 1].
    """

    def __init__(
        self,
        jacobian: ArrayLike,
        command: ArrayLike,
        *,
        low: ArrayLike,
        high: ArrayLike,
        axes: tuple[int, ...] = (0, 1, 2),
        gain: float = 1.0,
    ) -> None:
        self._jacobian = np.array(jacobian, dtype=np.float64)
        self._command = np.array(command, dtype=np.float64)
        self._low, self._high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        self._axes, self._gain = list(axes), gain
        self._last: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def command(self, tip: ArrayLike, goal: ArrayLike) -> NDArray[np.float64]:
        """Return the next command (actuators,).

        Args:
            tip: (3,) where the last command brought it [m].
            goal: (3,) where it shall be after this one [m].
        """
        tip = np.asarray(tip, dtype=np.float64)[self._axes]
        self._learn(tip)
        distance = np.asarray(goal, dtype=np.float64)[self._axes] - tip
        change = self._least_change(self._gain * distance)
        self._last, self._command = (tip, change), self._command + change
        return self._command.copy()

    def _least_change(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Find the least change of commands, within their ranges, that comes nearest to ``distance`` [m]."""
        scale = np.linalg.norm(self._jacobian, 2)
        rows = np.vstack([self._jacobian / scale, _LEAST * np.eye(len(self._command))])
        wanted = np.concatenate([distance / scale, np.zeros(len(self._command))])
        bounds = (np.minimum(self._low - self._command, -_TINY), np.maximum(self._high - self._command, _TINY))
        change = lsq_linear(rows, wanted, bounds).x
        return np.clip(self._command + change, self._low, self._high) - self._command

    def _learn(self, tip: NDArray[np.float64]) -> None:
        """Broyden's rank-one update from the last change of commands and the motion that followed."""
        if self._last is None:
            return
        before, change = self._last
        size = change @ change
        if size > 0.0:
            self._jacobian += np.outer(tip - before - self._jacobian @ change, change) / size


def circle(centre: ArrayLike, radius: float, turn: float) -> NDArray[np.float64]:
    """Return the point (3,) [m] of a circle in the y-z plane, ``turn`` (in turns) from its lowest point."""
    angle = 2.0 * np.pi * turn
    return np.asarray(centre, dtype=np.float64) + radius * np.array([0.0, np.sin(angle), -np.cos(angle)])
