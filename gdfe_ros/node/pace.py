# SPDX-License-Identifier: Apache-2.0
"""Pace of the steps: when the next step begins, and how much simulation time it covers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

_STILL = 1.0
"""An idle process that wakes up later than its next heartbeat by more than this time [s] has stood still, e.g. stopped
by a signal.
"""
FARTHEST_JUMP = 10.0
"""Largest forward jump of an external clock [s] for which steps are made. After a larger jump, the time is skipped."""


class ClockMode(str, Enum):
    """Clock that triggers the steps."""

    WALL = "wall"
    FAST = "fast"
    LOCKSTEP = "lockstep"
    EXTERNAL = "external"


@dataclass(frozen=True)
class Timing:
    """Present values of the parameters that determine the pace of the steps.

    Attributes:
        rate: steps per second of wall time [Hz].
        dt: simulation time of a step [s].
        heartbeat: interval of the steps while idle, called heartbeats [s]; 0: no heartbeats.
        ticking: whether to keep stepping while idle.
    """

    rate: float
    dt: float
    heartbeat: float
    ticking: bool


class Pace(Protocol):
    """Decides when to step.

    Attributes:
        overruns: number of steps that should have begun while an earlier step was still running.
        late: sum of the delays of steps that ended too late [s]; 0 without the wall clock.
        moment: time of the external clock at the end of the latest step [ns]; 0 without external clock.
        behind: time by which the external clock is ahead of ``moment`` [s]; 0 without external clock.
    """

    overruns: int
    late: float
    moment: int
    behind: float

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return the wall time to wait before the next step [s]: 0 to step now, None to wait for an event.

        Args:
            pending: whether orders for a step are waiting.
            settled: whether the state stays constant without new orders.
        """

    def begin(self) -> float:
        """Record that a step begins now and return the simulation time that it covers [s]."""

    def restart(self) -> None:
        """Ignore the wall time that has passed, e.g. in a pause."""


class _OwnPace:
    """A pace without an external clock."""

    moment, behind = 0, 0.0


class WallPace(_OwnPace):
    """Makes steps at a constant rate of wall time or, while idle, at the interval of the heartbeats.

    After an idle time of n periods, one step covers n dt, so that simulation time keeps up with wall time. If the
    process stood still, the time after the next heartbeat is skipped, and counts as overruns. A step that ends n
    periods too late counts as n overruns, even if the node is idle after it. Simulation time then stays behind
    by the missed periods.

    Args:
        timing: function that returns the present values of the parameters.
        now: function that returns the time on a monotonic clock [s].
    """

    def __init__(self, timing: Callable[[], Timing], now: Callable[[], float] = time.monotonic) -> None:
        self._timing, self._now = timing, now
        self.overruns, self.late = 0, 0.0
        self.restart()

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return the wall time to the next period [s] or, if idle, to the next heartbeat; None: no heartbeats."""
        timing, now = self._timing(), self._now()
        if self._running:
            self._end(now, 1.0 / timing.rate)
        if pending or not settled or timing.ticking:
            return max(0.0, self._due - now)
        self._idle = True
        return max(0.0, self._last + timing.heartbeat - now) if timing.heartbeat else None

    def begin(self) -> float:
        """Begin a step: advance to the next period, count missed periods, and return the step's simulation time [s]."""
        timing, now = self._timing(), self._now()
        period, periods = 1.0 / timing.rate, 1
        if self._idle:
            periods = max(1, round(self._idled(timing, now, period) / period))
            self._due = now
        else:
            self._end(now, period)
        self._due += period
        self._last, self._idle, self._running = now, False, True
        return periods * timing.dt

    def _idled(self, timing: Timing, now: float, period: float) -> float:
        """Return the idle time that a step covers [s]; time in which the process stood still is skipped and counted."""
        missed = now - self._last - timing.heartbeat
        if not timing.heartbeat or missed <= _STILL:
            return now - self._last
        self.overruns += int(missed / period)
        self.late += missed
        return timing.heartbeat

    def _end(self, now: float, period: float) -> None:
        """Record the end of a step. If the next step is late by a period or more, count overruns and restart now."""
        self._running = False
        if (late := now - self._due) >= period:
            self.overruns += int(late / period)
            self.late += late
            self._due, self._last = now, now - period

    def restart(self) -> None:
        """Restart the periods now."""
        self._last = self._due = self._now()
        self._idle = self._running = False


class FastPace(_OwnPace):
    """Makes steps without waiting while there is work or, while idle, at the interval of the heartbeats.

    Args:
        timing: function that returns the present values of the parameters.
        now: function that returns the time on a monotonic clock [s].
    """

    def __init__(self, timing: Callable[[], Timing], now: Callable[[], float] = time.monotonic) -> None:
        self._timing, self._now = timing, now
        self.overruns, self.late = 0, 0.0
        self.restart()

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return 0 while there is work, otherwise the wall time to the next heartbeat [s]; None: no heartbeats."""
        timing = self._timing()
        if pending or not settled or timing.ticking:
            return 0.0
        return max(0.0, self._last + timing.heartbeat - self._now()) if timing.heartbeat else None

    def begin(self) -> float:
        """Begin a step and return its simulation time, one dt [s]."""
        self._last = self._now()
        return self._timing().dt

    def restart(self) -> None:
        """Restart the interval of the heartbeats now."""
        self._last = self._now()


class LockstepPace(_OwnPace):
    """Makes a step only when a command set is complete.

    Args:
        timing: function that returns the present values of the parameters.
    """

    def __init__(self, timing: Callable[[], Timing]) -> None:
        self._timing = timing
        self.overruns, self.late = 0, 0.0

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return 0 if a command set is complete, else None."""
        return 0.0 if pending else None

    def begin(self) -> float:
        """Begin a step and return its simulation time, one dt [s]."""
        return self._timing().dt

    def restart(self) -> None:
        """Do nothing: wall time has no effect."""


class ExternalPace:
    """Follows an external clock: one step of dt whenever the clock has advanced by dt, none while it stands still.

    While there is work, every step covers one dt, and none is skipped. A run thus depends only on the clock and the
    commands, and not on the speed of this machine. On a slow machine steps fall behind and count as overruns. After an
    idle time, one step covers all the elapsed time. If the clock goes back, or jumps ahead by more than
    `FARTHEST_JUMP`, the steps continue from its new time. No steps are made for the skipped time.

    Args:
        timing: function that returns the present values of the parameters.
        now: function that returns the time of the clock [ns]; 0 before the time is known.
        tell: function that receives a message about each jump of the clock.
    """

    def __init__(
        self, timing: Callable[[], Timing], now: Callable[[], int], tell: Callable[[str], object] = lambda text: None
    ) -> None:
        self._timing, self._now, self._tell = timing, now, tell
        self.overruns, self.late, self.moment = 0, 0.0, 0
        self._idle = False
        self._leapt = 0
        self.restart()

    @property
    def behind(self) -> float:
        """Time by which the clock is ahead of the end of the latest step [s]."""
        return 1e-9 * max(0, self._now() - self.moment - self._leapt) if self.moment else 0.0

    def jumped(self, ahead: int) -> None:
        """Record a jump of the clock by ``ahead`` [ns]; callable from any thread."""
        if ahead > round(1e9 * FARTHEST_JUMP) and self.moment:
            self._leapt += ahead

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return 0 if a step of dt is due, or a heartbeat while idle; otherwise None, to wait for the clock."""
        timing, due = self._timing(), self._due()
        if pending or not settled or timing.ticking:
            return 0.0 if due else None
        self._idle = True
        return 0.0 if due and timing.heartbeat and due * timing.dt >= timing.heartbeat else None

    def begin(self) -> float:
        """Begin a step and return its simulation time [s]: one dt, or all the time that passed while idle."""
        due = max(1, self._due())
        count = due if self._idle else 1
        self.overruns += due - 1 > 0 and not self._idle
        self._idle = False
        dt = self._timing().dt
        self.moment += round(1e9 * dt) * count
        return count * dt

    def restart(self) -> None:
        """Continue from the present time of the clock."""
        self.moment, self._leapt = self._now(), 0

    def _due(self) -> int:
        """Return the number of steps of dt that are due; after a jump, continue from the clock's new time."""
        now = self._now()
        back = now < self.moment - round(1e9 * self._timing().dt)
        if self.moment and (back or self._leapt):
            text = f"the clock jumped {'back' if back else 'ahead'} from {1e-9 * self.moment:.9g} to {1e-9 * now:.9g} s"
            self._tell(f"{text}: the simulation goes on from there, at its own time, and makes no steps for the jump")
        if self.moment == 0 or back or self._leapt:
            self.restart()
        return max(0, (now - self.moment) // round(1e9 * self._timing().dt))


def make_pace(
    mode: ClockMode,
    timing: Callable[[], Timing],
    now: Callable[[], int],
    tell: Callable[[str], object] = lambda text: None,
) -> Pace:
    """Return the pace of a clock mode; ``now`` returns the node's time [ns], ``tell`` receives texts about jumps."""
    if mode is ClockMode.EXTERNAL:
        return ExternalPace(timing, now, tell)
    kinds = {ClockMode.WALL: WallPace, ClockMode.FAST: FastPace, ClockMode.LOCKSTEP: LockstepPace}
    return kinds[mode](timing)
