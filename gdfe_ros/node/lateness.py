# SPDX-License-Identifier: Apache-2.0
"""Warnings that steps end too late, so that simulation time falls behind the clock, take long, or do not converge."""

from __future__ import annotations

import time
from dataclasses import dataclass

from gdfe_ros.node.pace import Pace
from gdfe_ros.node.throttle import Throttle
from gdfe_ros.recording.step import Step

_LONG = 10.0
"""A step that takes longer than this time [s] is reported, and again when its duration has doubled."""
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

    def look(self, pace: Pace | None, *, steps: int, rate: float, at: float, slewing: bool = False) -> str | None:
        """Return the text of a warning; None if the steps are not late, or a warning was given a moment ago.

        Args:
            pace: pace of the steps; None while there is none.
            steps: number of steps so far.
            rate: requested steps per second of wall time [Hz].
            at: simulation time [s].
            slewing: whether `slew_time` delays a command.
        """
        if pace is None:
            return None
        last, self._mark = self._mark, _Mark(steps, pace.overruns, pace.late)
        if pace.behind > _FAR:
            text = f"is {pace.behind:.3f} s behind the clock it follows: its steps take longer than dt"
            return self._told("behind", at, text)
        made, late = max(1, steps - last.steps), pace.late - last.late
        if pace.overruns <= last.overruns or late <= 0.0:
            return None
        reached = made / (made / rate + late)
        figures = f"rate asked {rate:.4g} Hz, reached {reached:.4g} Hz, late by {pace.late:.3f} s so far"
        remedy = "remedy: a lower rate with a larger dt, a coarser mesh, or a deadline"
        if slewing:
            remedy += "; a command crosses its range in slew_time / dt steps, with a smaller slew_time in fewer"
        return self._told("late", at, f"falls behind wall time: {figures}; {remedy}")

    def _told(self, subject: str, at: float, text: str) -> str | None:
        more = self._throttle.due(subject)
        return None if more is None else f"the simulation, at {at:.9g} s, {text}{more}"


class Solves:
    """Watches the solves of a session: those that take long, and those that did not converge."""

    def __init__(self) -> None:
        self._throttle, self._known = Throttle(), -1
        self._begun, self._patience = 0.0, _LONG

    def look(self, last: Step | None) -> str | None:
        """Return the text of a warning if the last step did not converge; None if it did, or if it was reported before.

        A step that a deadline ended is continued by the next one, and is not reported.
        """
        if last is None or last.record.step == self._known:
            return None
        self._known = last.record.step
        result = last.result
        if result.converged or result.cut_after is not None or (more := self._throttle.due("solve")) is None:
            return None
        text = f"step {self._known} to {last.record.time:.9g} s did not converge after {result.iterations} iterations"
        return f"{text}: {result.message or 'there may be no equilibrium at this command'}{more}"

    def wait(self, work: tuple[str, float] | None) -> str | None:
        """Return the text of a warning if the present ``work``, its name and start [s], takes long; else None."""
        if work is None:
            return None
        name, begun = work
        if begun != self._begun:
            self._begun, self._patience = begun, _LONG
        spent = time.monotonic() - begun
        if spent < self._patience:
            return None
        self._patience = 2.0 * spent
        return f"{name} has taken {spent:.0f} s so far; ~/reset ends it"
