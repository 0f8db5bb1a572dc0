# SPDX-License-Identifier: Apache-2.0
"""A controller that closes a gripper until a contact sensor measures a wanted force, and then keeps this force."""

from __future__ import annotations

import math

_LEAST = 0.1
"""Least change of the command, divided by the stride, that updates the slope. With a smaller change, the solver's
tolerance and the sensor's noise would dominate the slope."""


class ForceCloser:
    """Controller that finds the command at which a closing actuator or handle exerts a wanted force. Needs no ROS.

    While no force is measured, the command changes by one stride in each step. During contact it changes by
    (goal - force) / slope, but at most by one stride. The slope d force / d command is the secant of two successive
    steps with contact. Until it is known, the command changes by one stride towards the goal. Stiffness and position
    of the grasped object need not be known.

    Args:
        goal: wanted force [N], above ``threshold``.
        stride: largest change of the command in a step, in its unit; negative if a decreasing command closes.
        low: least command.
        high: largest command.
        threshold: force up to which there is no contact [N], above 0.

    Raises:
        ValueError: an argument is out of its range.
    """

    def __init__(
        self, goal: float, stride: float, *, low: float = -math.inf, high: float = math.inf, threshold: float = 1e-3
    ) -> None:
        if not (goal > threshold > 0.0 and stride and math.isfinite(goal) and math.isfinite(stride) and low < high):
            raise ValueError(
                f"goal {goal} N, threshold {threshold} N, stride {stride}, range {low} to {high}; allowed: "
                "0 < threshold < goal, a stride that is not 0, finite numbers, and a range that is not empty"
            )
        self._goal, self._stride, self._low, self._high, self._threshold = goal, stride, low, high, threshold
        self._slope = 0.0
        self._last: tuple[float, float] | None = None

    def command(self, force: float, applied: float) -> float:
        """Return the next command.

        Args:
            force: magnitude of the measured force [N].
            applied: command that was in force at the measurement.
        """
        self._learn(force, applied)
        change = self._stride
        if force > self._threshold and self._slope * self._stride > 0.0:
            change = (self._goal - force) / self._slope
        elif force > self._goal:
            change = -self._stride
        most = abs(self._stride)
        return min(max(applied + min(max(change, -most), most), self._low), self._high)

    def _learn(self, force: float, applied: float) -> None:
        """Update the slope by the secant, if the command changed enough and the force increased with closing."""
        if self._last is not None and min(force, self._last[0]) > self._threshold:
            rise, change = force - self._last[0], applied - self._last[1]
            if abs(change) > _LEAST * abs(self._stride) and rise * change * self._stride > 0.0:
                self._slope = rise / change
        self._last = force, applied
