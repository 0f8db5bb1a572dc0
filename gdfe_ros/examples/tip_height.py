# SPDX-License-Identifier: Apache-2.0
"""A controller that brings the tip of an oscillating body to a height and damps the oscillation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Gains of a controller from a height to a pressure; the defaults are for the scene `swinging_arm`.

    Attributes:
        proportional: proportional gain [Pa/m].
        integral: integral gain [Pa/(m s)]; the integral part of the pressure balances the weight.
        derivative: derivative gain [Pa s/m], which damps the oscillation. The damping ratio of a soft body is only a
            few per cent. Without this gain, the integral adds more energy to an oscillation than the body dissipates.
    """

    proportional: float = 1e5
    integral: float = 3e6
    derivative: float = 1.5e4


class TipHeight:
    """PID control of a tip's height by chambers that raise it and chambers that lower it. Needs no ROS.

    The controller differentiates the height, not the error, so that a jump of the goal has no effect on the derivative.
    The integral stays constant while the pressure is at its limit.

    Args:
        goal: wanted height [m]; may be changed at any time.
        raising: names of the chambers that raise the tip.
        lowering: names of the chambers that lower the tip.
        gains: gains of the controller; None: the defaults of `Gains`.
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
            time: time of the measurement [s]. If it is before the last measurement, integral and derivative are reset.
            height: height of the tip at that time [m].
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
