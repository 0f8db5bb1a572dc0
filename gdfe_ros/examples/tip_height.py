# SPDX-License-Identifier: Apache-2.0
"""A controller for a body that swings: it brings a tip to a height and takes the swing out on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Of a controller from a height to a pressure; the defaults are for the scene `swinging_arm`.

    Attributes:
        proportional: [Pa/m].
        integral: [Pa/(m s)]; carries the weight.
        derivative: [Pa s/m]; takes the swing out. A soft body damps itself by a few per cent only: the integral alone
            adds more to a swing than the body takes from it.
    """

    proportional: float = 1e5
    integral: float = 3e6
    derivative: float = 1.5e4


class TipHeight:
    """PID control of a tip's height by chambers that raise it and chambers that lower it. No ROS in here.

    The derivative is that of the height, not of its distance to the goal, so that a goal that jumps does not kick. The
    integral stands still while the pressure is at its limit.

    Args:
        goal: height [m]; may be changed at any time.
        raising: names of the chambers that raise the tip.
        lowering: names of those that lower it.
        gains: of the controller.
        most: largest pressure [Pa].
    """

    def __init__(
        self,
        goal: float,
        *,
        raising: Sequence[str] = ("left", "right"),
        lowering: Sequence[str] = ("upper",),
        gains: Gains | None = None,
        most: float = 25e3,
    ) -> None:
        self.goal = goal
        self._raising, self._lowering, self._gains, self._most = raising, lowering, gains or Gains(), most
        self._carried = 0.0
        self._last: tuple[float, float] | None = None

    def command(self, time: float, height: float) -> dict[str, float]:
        """Return the next pressure [Pa] of each chamber.

        Args:
            time: of the measurement [s]; where it goes back, what was learned before is forgotten.
            height: of the tip then [m].
        """
        if self._last is not None and time < self._last[0]:
            self._carried, self._last = 0.0, None
        span, rate = 0.0, 0.0
        if self._last is not None and time > self._last[0]:
            span = time - self._last[0]
            rate = (height - self._last[1]) / span
        self._last = time, height
        gains, away = self._gains, self.goal - height
        carried = self._carried + gains.integral * away * span
        wanted = gains.proportional * away + carried - gains.derivative * rate
        if abs(wanted) <= self._most:
            self._carried = carried
        pressure = float(np.clip(wanted, -self._most, self._most))
        raised = dict.fromkeys(self._raising, max(pressure, 0.0))
        return raised | dict.fromkeys(self._lowering, max(-pressure, 0.0))
