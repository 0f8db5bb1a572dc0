# SPDX-License-Identifier: Apache-2.0
"""Choice of the time of each step in each clock mode, and warnings about late, long and failed steps."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from enum import Enum
from typing import TYPE_CHECKING, Any

from gdfe_ros.untrusted.bounded_text import Throttle

if TYPE_CHECKING:
    from gdfe_ros.recording.step import Step

_STILL = 1.0
"""If an idle process wakes up more than this time [s] after a heartbeat was due, it stood still, e.g. stopped by a
signal.
"""
FARTHEST_JUMP = 10.0
"""Largest forward jump of an external clock [s] for which steps are made. After a larger jump, the time is skipped."""


class ClockMode(str, Enum):
    """Clock that triggers the steps."""

    WALL = "wall"
    FAST = "fast"
    LOCKSTEP = "lockstep"
    EXTERNAL = "external"


class _OwnPace:
    """Base class of paces without an external clock; a pace decides when to make a step.

    Each pace has three methods. `delay` returns the wall time to wait before the next step [s]: 0 to step now, None to
    wait for an event. It depends on whether orders are ``pending``, and on whether the state is ``settled``, i.e. stays
    constant without new orders. A wait in progress lasts at most one more period after ``rate``, or one more interval
    after ``heartbeat``, has changed. `begin` records that a step begins now, and returns the simulation time that the
    step covers [s]. `restart` ignores the wall time that has passed, e.g. in a pause.

    Args:
        values: present values of the node's parameters ``rate`` [Hz], ``dt`` [s], ``heartbeat`` [s] and
            ``publish_clock``, by name. With ``publish_clock`` steps are made while idle, too.
        now: function that returns the time on a monotonic clock [s].

    Attributes:
        overruns: number of steps that should have begun while an earlier step was still running.
        late: sum of the delays of steps that ended too late [s]; 0 without the wall clock.
        moment: time of the external clock at the end of the latest step [ns]; 0 without external clock.
        behind: time by which the external clock is ahead of ``moment`` [s]; 0 without external clock.
    """

    moment, behind = 0, 0.0

    def __init__(self, values: Mapping[str, Any], now: Callable[[], float] = time.monotonic) -> None:
        self._values, self._now = values, now
        self.overruns, self.late = 0, 0.0
        self.restart()

    def restart(self) -> None:
        """Forget the wall time that has passed."""
        self._mark(self._now())

    def begin(self) -> float:
        """Begin a step and return its simulation time, one dt [s]."""
        self._mark(self._now())
        return self._values["dt"]

    def _mark(self, now: float) -> None:
        """Count the time to the next heartbeat from ``now`` on."""
        self._last, self._interval = now, self._values["heartbeat"] or math.inf

    def _until_heartbeat(self) -> float | None:
        """Return the wall time to the next heartbeat [s]; None: there are no heartbeats."""
        heartbeat, idle = self._values["heartbeat"], self._now() - self._last
        self._interval = min(self._interval, idle + heartbeat) if heartbeat else math.inf
        return max(0.0, self._interval - idle) if heartbeat else None


class WallPace(_OwnPace):
    """Makes steps at a constant rate of wall time or, while idle, at the interval of the heartbeats.

    After an idle time of n periods, one step covers n dt, so that simulation time keeps up with wall time. If the
    process stood still, the time after the next heartbeat is skipped, and counts as overruns. A step that ends n
    periods too late counts as n overruns, even if the node is idle after it. Simulation time then stays behind
    by the missed periods.
    """

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return the wall time to the next period [s] or, if idle, to the next heartbeat; None: no heartbeats."""
        now = self._now()
        if self._running:
            self._end(now, 1.0 / self._values["rate"])
        self._due = min(self._due, now + 1.0 / self._values["rate"])
        if pending or not settled or self._values["publish_clock"]:
            return max(0.0, self._due - now)
        self._idle = True
        return self._until_heartbeat()

    def begin(self) -> float:
        """Begin a step: advance to the next period, count missed periods, and return the step's simulation time [s]."""
        now = self._now()
        period, periods = 1.0 / self._values["rate"], 1
        if self._idle:
            periods = max(1, round(self._count_idle(now, period) / period))
            self._due = now
        else:
            self._end(now, period)
        self._due += period
        self._mark(now)
        self._idle, self._running = False, True
        return periods * self._values["dt"]

    def _count_idle(self, now: float, period: float) -> float:
        """Return the idle time that a step covers [s]; time of a stopped process is left out and counts as overruns."""
        missed = now - self._last - self._interval
        if missed <= _STILL:
            return now - self._last
        self.overruns += int(missed / period)
        self.late += missed
        return self._interval

    def _end(self, now: float, period: float) -> None:
        """Record the end of a step.

        If the next step is late by a period or more, count overruns and restart the periods.
        """
        self._running = False
        if (late := now - self._due) >= period:
            self.overruns += int(late / period)
            self.late += late
            self._due, self._last = now, now - period

    def restart(self) -> None:
        """Restart the periods now."""
        self._due = self._now()
        self._mark(self._due)
        self._idle = self._running = False


class FastPace(_OwnPace):
    """Makes steps without waiting while there is work or, while idle, at the interval of the heartbeats."""

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return 0 while there is work, otherwise the wall time to the next heartbeat [s]; None: no heartbeats."""
        busy = pending or not settled or self._values["publish_clock"]
        return 0.0 if busy else self._until_heartbeat()


class LockstepPace(_OwnPace):
    """Makes a step only when a command set is complete."""

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return 0 if a command set is complete, else None."""
        return 0.0 if pending else None


class ExternalPace:
    """Follows an external clock: one step of dt whenever the clock has advanced by dt, none while it stands still.

    While there is work, every step covers one dt, and none is skipped. A run thus depends only on the clock and the
    commands, and not on the speed of this machine. On a slow machine steps fall behind and count as overruns. After an
    idle time, one step covers all the elapsed time. If the clock goes back, or jumps ahead by more than
    `FARTHEST_JUMP`, the steps continue from its new time. No steps are made for the skipped time.

    Args:
        values: present values of the node's parameters by name, as for `WallPace`.
        now: function that returns the time of the clock [ns]; 0 before the time is known.
        tell: function that receives a message about each jump of the clock.
    """

    def __init__(self, values: Mapping[str, Any], now: Callable[[], int], tell: Callable[[str], object]) -> None:
        self._values, self._now, self._tell = values, now, tell
        self.overruns, self.late, self.moment = 0, 0.0, 0
        self._idle = False
        self._leapt = 0
        self.restart()

    @property
    def behind(self) -> float:
        """Time by which the clock is ahead of the end of the latest step [s]."""
        return 1e-9 * max(0, self._now() - self.moment - self._leapt) if self.moment else 0.0

    def record_jump(self, ahead: int) -> None:
        """Record a jump of the clock by ``ahead`` [ns]; callable from any thread."""
        if ahead > round(1e9 * FARTHEST_JUMP) and self.moment:
            self._leapt += ahead

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return 0 if a step of dt or, while idle, a heartbeat is due; otherwise None, to wait for the clock."""
        heartbeat, due = self._values["heartbeat"], self._due()
        if pending or not settled or self._values["publish_clock"]:
            return 0.0 if due else None
        self._idle = True
        return 0.0 if due and heartbeat and due * self._values["dt"] >= heartbeat else None

    def begin(self) -> float:
        """Begin a step and return its simulation time [s]: one dt, or all the time that passed while idle."""
        due = max(1, self._due())
        count = due if self._idle else 1
        self.overruns += due - 1 > 0 and not self._idle
        self._idle = False
        dt = self._values["dt"]
        self.moment += round(1e9 * dt) * count
        return count * dt

    def restart(self) -> None:
        """Continue from the present time of the clock."""
        self.moment, self._leapt = self._now(), 0

    def _due(self) -> int:
        """Return the number of steps of dt that are due; after a jump, continue from the clock's new time."""
        now, step = self._now(), round(1e9 * self._values["dt"])
        back = now < self.moment - step
        if self.moment and (back or self._leapt):
            text = f"the clock jumped {'back' if back else 'ahead'} from {1e-9 * self.moment:.9g} to {1e-9 * now:.9g} s"
            self._tell(f"{text}: the simulation goes on from there, at its own time, and makes no steps for the jump")
        if self.moment == 0 or back or self._leapt:
            self.restart()
        return max(0, (now - self.moment) // step)


Pace = WallPace | FastPace | LockstepPace | ExternalPace


def make_pace(
    mode: ClockMode, values: Mapping[str, Any], now: Callable[[], int], tell: Callable[[str], object]
) -> Pace:
    """Return the pace of a clock mode.

    Args:
        mode: the clock mode.
        values: present values of the node's parameters by name.
        now: function that returns the node's time [ns].
        tell: function that receives texts about jumps of an external clock.
    """
    if mode is ClockMode.EXTERNAL:
        return ExternalPace(values, now, tell)
    kinds = {ClockMode.WALL: WallPace, ClockMode.FAST: FastPace, ClockMode.LOCKSTEP: LockstepPace}
    return kinds[mode](values)


_LONG = 10.0
"""A step that takes longer than this time [s] is reported, and again when its duration has doubled."""
_FAR = 1.0
"""A warning is given if the simulation lags behind an external clock by more than this time [s]."""


class Lateness:
    """Watches the pace of a session, and describes its lateness at most once in five seconds."""

    def __init__(self) -> None:
        self._throttle, self._mark = Throttle(), (0, 0, 0.0)

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
        (before, overruns, late), self._mark = self._mark, (steps, pace.overruns, pace.late)
        if pace.behind > _FAR:
            text = f"is {pace.behind:.3f} s behind the clock it follows: its steps take longer than dt"
            return self._describe("behind", at, text)
        made, late = max(1, steps - before), pace.late - late
        if pace.overruns <= overruns or late <= 0.0:
            return None
        reached = made / (made / rate + late)
        figures = f"rate asked {rate:.4g} Hz, reached {reached:.4g} Hz, late by {pace.late:.3f} s so far"
        remedy = "remedy: a lower rate with a larger dt, a coarser mesh, or a deadline"
        if slewing:
            remedy += "; a command crosses its range in slew_time / dt steps, with a smaller slew_time in fewer"
        return self._describe("late", at, f"falls behind wall time: {figures}; {remedy}")

    def _describe(self, subject: str, at: float, text: str) -> str | None:
        more = self._throttle.due(subject)
        return None if more is None else f"the simulation, at {at:.9g} s, {text}{more}"


class Solves:
    """Describes the solves of a session that take long, do not converge, or return a message."""

    def __init__(self) -> None:
        self._throttle, self._known = Throttle(), -1
        self._begun, self._patience = 0.0, _LONG

    def look(self, last: Step | None) -> str | None:
        """Return the text of a warning if the last step did not converge, or has a message; else None.

        Each step is reported once. Two kinds are never reported: steps that a deadline ended, because the next step
        continues them, and states that are published without a solve, e.g. after a body was added.
        """
        if last is None or last.first or last.record.step == self._known:
            return None
        self._known = last.record.step
        result = last.result
        silent = result.cut_after is not None or (result.converged and not result.message)
        if silent or (more := self._throttle.due("said" if result.converged else "solve")) is None:
            return None
        if result.converged:
            return f"step {self._known} to {last.record.time:.9g} s: {result.message}{more}"
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
