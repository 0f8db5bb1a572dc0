# SPDX-License-Identifier: Apache-2.0
"""A controller that moves a tip along a path: resolved-rate control with a Jacobian that measurements correct."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import lsq_linear

_LEAST = 1e-3
"""Weight of the change of the commands in the least-squares problem, relative to the distance."""
_TINY = 1e-12
"""Change that is allowed in each direction even at the end of a range, because the least-squares solver needs two
different bounds.
"""


class TipTracker:
    """Finds commands for actuators that bring a tip to its goals. Needs no ROS.

    A command is the one in force at the measurement of the tip, plus a change. It is the least change that, by the
    Jacobian, moves the tip by ``gain`` times the distance to the goal. Earlier commands may thus be late or lost.

    Broyden's update corrects the Jacobian by measured motions; therefore it is computed only once. Motions are added up
    until they reach ``baseline``. In a smaller motion, the solver's tolerance or a sensor's noise would dominate the
    correction.

    Args:
        jacobian: (axes, actuators) d position / d command at the start.
        command: (actuators,) commands at the start.
        low: (actuators,) least commands.
        high: (actuators,) largest commands.
        axes: indices of the controlled coordinates x, y, z.
        gain: fraction of the distance that one command covers, in (0, 1].
        baseline: least motion that corrects the Jacobian [m]; a hundred times the noise is enough.
        reach: largest motion of the tip for which one command is computed [m].
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
            tip: (3,) measured position [m].
            goal: (3,) position that is wanted when the command takes effect [m].
            applied: (actuators,) commands in force when the tip was measured; None: those returned last.
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
        """Exclude the next motion from the correction of the Jacobian, because something else moved the body."""
        self._known = None

    def _least_change(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the least change of commands (actuators,), within their ranges, that best gives ``distance`` [m]."""
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
    """Return the point (3,) [m] of a circle in the y-z plane, ``turn`` revolutions after its lowest point."""
    angle = 2.0 * np.pi * turn
    return np.asarray(centre, dtype=np.float64) + radius * np.array([0.0, np.sin(angle), -np.cos(angle)])
