# SPDX-License-Identifier: Apache-2.0
"""The controller under test: it needs no ROS and no simulator."""


class TipHeight:
    """Integral control of the tip's height by one tendon.

    Args:
        goal: wanted height of the tip [m].
        gain: change of the tension [N] for an error of a metre in one step.
    """

    def __init__(self, goal: float, gain: float) -> None:
        self._goal, self._gain, self._tension = goal, gain, 0.0

    def tension(self, height: float) -> float:
        """Return the next tension [N] for a measured height [m]; a tension lowers the tip."""
        self._tension = max(0.0, self._tension + self._gain * (height - self._goal))
        return self._tension
