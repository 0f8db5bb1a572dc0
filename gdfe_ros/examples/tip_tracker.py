# SPDX-License-Identifier: Apache-2.0
"""A controller that moves a tip along a path: resolved-rate control with a Jacobian that measurements correct."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import lsq_linear

_LEAST = 1e-3
"""Weight of the change of the commands in the least-squares problem, relative to the weight of the distance."""
_TINY = 1e-12
"""Least change allowed in both directions, even at the end of a range, because the least-squares solver needs two
different bounds.
"""


class TipTracker:
    """Controller that finds actuator commands that bring a tip to its goals. Needs no ROS.

    The next command is the command in force at the measurement of the tip, plus a change. The change is the smallest
    one that, according to the Jacobian, moves the tip by ``gain`` times the distance to the goal. Because it is added
    to the command in force, late or lost commands do no harm.

    The initial Jacobian is given. Broyden's update corrects it with measured motions. Motions are summed until they
    reach ``baseline``, because the solver's tolerance or a sensor's noise would dominate corrections by smaller ones.

    Args:
        jacobian: initial d position / d command (axes, actuators).
        command: initial commands (actuators,).
        low: least commands (actuators,).
        high: largest commands (actuators,).
        axes: indices of the controlled coordinates x, y, z.
        gain: fraction of the distance that one command covers, in (0, 1].
        baseline: least motion that corrects the Jacobian [m]; a hundred times the sensor's noise is sufficient.
        reach: largest motion of the tip that one command may demand [m].
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
        baseline: float = 0.0,
        reach: float = np.inf,
    ) -> None:
        self._jacobian = np.array(jacobian, dtype=np.float64)
        self._command = np.array(command, dtype=np.float64)
        self._low, self._high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        self._axes, self._gain, self._baseline, self._reach = list(axes), gain, baseline, reach
        self._known: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def command(self, tip: ArrayLike, goal: ArrayLike, applied: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the next command (actuators,).

        Args:
            tip: measured position (3,) [m].
            goal: wanted position at the time when the command takes effect (3,) [m].
            applied: commands in force when the tip was measured (actuators,); None: the last returned commands.
        """
        tip = np.asarray(tip, dtype=np.float64)[self._axes]
        if applied is not None:
            self._command = np.array(applied, dtype=np.float64)
        self._learn(tip)
        distance = self._gain * (np.asarray(goal, dtype=np.float64)[self._axes] - tip)
        distance *= min(1.0, self._reach / max(float(np.linalg.norm(distance)), _TINY))
        self._command = self._command + self._least_change(distance)
        return self._command.copy()

    def forget(self) -> None:
        """Do not use the next motion to correct the Jacobian, because something other than a command moved the tip."""
        self._known = None

    def _least_change(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the smallest change of commands (actuators,) within ranges that moves the tip by ``distance`` [m]."""
        scale = np.linalg.norm(self._jacobian, 2)
        rows = np.vstack([self._jacobian / scale, _LEAST * np.eye(len(self._command))])
        wanted = np.concatenate([distance / scale, np.zeros(len(self._command))])
        bounds = (np.minimum(self._low - self._command, -_TINY), np.maximum(self._high - self._command, _TINY))
        change = lsq_linear(rows, wanted, bounds).x
        return np.clip(self._command + change, self._low, self._high) - self._command

    def _learn(self, tip: NDArray[np.float64]) -> None:
        """Correct the Jacobian by Broyden's rank-one update, from a change of commands and the measured motion."""
        if self._known is None:
            self._known = tip, self._command
            return
        motion, change = tip - self._known[0], self._command - self._known[1]
        if not change.any() or max(np.linalg.norm(motion), np.linalg.norm(self._jacobian @ change)) < self._baseline:
            return
        self._jacobian += np.outer(motion - self._jacobian @ change, change) / (change @ change)
        self._known = tip, self._command


def circle(centre: ArrayLike, radius: float, turn: float) -> NDArray[np.float64]:
    """Return a point (3,) [m] on a circle in the y-z plane, ``turn`` revolutions after the circle's lowest point."""
    angle = 2.0 * np.pi * turn
    return np.asarray(centre, dtype=np.float64) + radius * np.array([0.0, np.sin(angle), -np.cos(angle)])
