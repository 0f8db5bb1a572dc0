# SPDX-License-Identifier: Apache-2.0
"""A controller that closes until a contact sensor reads a force, and holds it there."""

from __future__ import annotations

import math

_LEAST = 0.1
"""Change of the command over the stride from which the force's rise is learnt: what a solver's tolerance or a sensor's
noise leaves open would make nonsense of a smaller one's."""


class ForceCloser:
    """Finds the command of an actuator, or of anything else that closes, at which a force is felt. No ROS in here.

    While nothing is felt it closes by a stride a step. Then it goes by how much the force rose with the command, the
    secant of the last two steps, and never by more than the stride: it needs to know neither the stiffness of what is
    grasped nor where that is.

    Args:
        goal: the force [N], above 0.
        stride: largest change of the command in a step, in its unit; negative where less closes.
        low: least command.
        high: largest command.
        threshold: a smaller force is none [N].

    Raises:
        ValueError: an argument is not as stated.
    """

    def __init__(
        self, goal: float, stride: float, *, low: float = -math.inf, high: float = math.inf, threshold: float = 1e-3
    ) -> None:
        if not (goal > threshold > 0.0 and stride and math.isfinite(goal) and math.isfinite(stride) and low < high):
            raise ValueError(
                f"goal {goal} N, threshold {threshold} N, stride {stride}, range {low} to {high}: needed are "
                "0 < threshold < goal, a stride that is not 0, finite numbers, and a range that is not empty"
            )
        self._goal, self._stride, self._low, self._high, self._threshold = goal, stride, low, high, threshold
        self._slope = 0.0
        self._last: tuple[float, float] | None = None

    def command(self, force: float, applied: float) -> float:
        """Return the next command.

        Args:
            force: magnitude that is felt [N].
            applied: command at which it is felt.
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
        """Take the secant; where the command hardly moved, or the force fell while it closed, it says nothing."""
        if self._last is not None and min(force, self._last[0]) > self._threshold:
            rise, change = force - self._last[0], applied - self._last[1]
            if abs(change) > _LEAST * abs(self._stride) and rise * change * self._stride > 0.0:
                self._slope = rise / change
        self._last = force, applied
