# SPDX-License-Identifier: Apache-2.0
"""Warnings that steps end too late, so that simulation time falls behind the clock."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.node.pace import Pace
from gdfe_ros.node.throttle import Throttle

_FAR = 1.0
"""A warning is given if the simulation lags behind an external clock by more than this time [s]."""


@dataclass(frozen=True)
class _Mark:
    """Counters of a pace at one moment."""

    steps: int = 0
    overruns: int = 0
    late: float = 0.0


class Lateness:
    """Watches the pace of a session, and describes its lateness at most once in five seconds."""

    def __init__(self) -> None:
        self._throttle, self._mark = Throttle(), _Mark()

    def look(self, pace: Pace | None, *, steps: int, rate: float, time: float) -> str | None:
        """Return the text of a warning; None if the steps are not late, or a warning was given a moment ago.

        Args:
            pace: pace of the steps; None while there is none.
            steps: number of steps so far.
            rate: requested steps per second of wall time [Hz].
            time: simulation time [s].
        """
        if pace is None:
            return None
        last, self._mark = self._mark, _Mark(steps, pace.overruns, pace.late)
        if pace.behind > _FAR:
            text = f"is {pace.behind:.3f} s behind the clock it follows: its steps take longer than dt"
            return self._told("behind", time, text)
        made, late = max(1, steps - last.steps), pace.late - last.late
        if pace.overruns <= last.overruns or late <= 0.0:
            return None
        reached = made / (made / rate + late)
        figures = f"rate asked {rate:.4g} Hz, reached {reached:.4g} Hz, late by {pace.late:.3f} s so far"
        remedy = "remedy: a lower rate with a larger dt, a coarser mesh, or a deadline"
        return self._told("late", time, f"falls behind wall time: {figures}; {remedy}")

    def _told(self, subject: str, time: float, text: str) -> str | None:
        more = self._throttle.due(subject)
        return None if more is None else f"the simulation, at {time:.9g} s, {text}{more}"
