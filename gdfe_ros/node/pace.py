# SPDX-License-Identifier: Apache-2.0
"""Pace of the steps: when the next one begins, and how much simulation time it covers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

FARTHEST_JUMP = 10.0
"""Largest jump of an external clock [s] that is followed by steps; after a larger jump only its new time is adopted."""


class ClockMode(str, Enum):
    """Clock that triggers the steps."""

    WALL = "wall"
    FAST = "fast"
    LOCKSTEP = "lockstep"
    EXTERNAL = "external"


@dataclass(frozen=True)
class Timing:
    """Present values of the parameters that pace the steps.

    Attributes:
        rate: steps per second of wall time [Hz].
        dt: simulation time of a step [s].
        heartbeat: interval of steps while idle [s]; 0: none.
        ticking: whether to keep stepping while idle.
    """

    rate: float
    dt: float
    heartbeat: float
    ticking: bool


class Pace(Protocol):
    """Decides when to step.

    Attributes:
        overruns: steps that should have begun while an earlier one was still running.
        late: total delay of the ends of steps [s].
        moment: time on an external clock at the end of the step that began last [ns]; 0 without such a clock.
        behind: lead of the external clock over ``moment`` [s]; 0 without such a clock.
    """

    overruns: int
    late: float
    moment: int
    behind: float

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return the wall time to wait [s]: 0 to step now, None to wait for an event.

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
    """Steps at a rate of wall time; while idle, only heartbeats.

    An idle time of n periods becomes one step of n dt, so that simulation time keeps up with wall time. A step that
    ends n periods too late counts as n overruns, even if the node is idle after it. Simulation time then stays behind
    by the missed periods.

    Args:
        timing: returns the present values.
        now: monotonic clock [s].
    """

    def __init__(self, timing: Callable[[], Timing], now: Callable[[], float] = time.monotonic) -> None:
        self._timing, self._now = timing, now
        self.overruns, self.late = 0, 0.0
        self.restart()

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return the time to the next period of the rate, or to the heartbeat if idle."""
        timing, now = self._timing(), self._now()
        if self._running:
            self._end(now, 1.0 / timing.rate)
        if pending or not settled or timing.ticking:
            return max(0.0, self._due - now)
        self._idle = True
        return max(0.0, self._last + timing.heartbeat - now) if timing.heartbeat else None

    def begin(self) -> float:
        """Advance to the next period and count missed ones."""
        timing, now = self._timing(), self._now()
        period, periods = 1.0 / timing.rate, 1
        if self._idle:
            periods = max(1, round((now - self._last) / period))
            self._due = now
        else:
            self._end(now, period)
        self._due += period
        self._last, self._idle, self._running = now, False, True
        return periods * timing.dt

    def _end(self, now: float, period: float) -> None:
        """Record the end of a step; if the next one is overdue by a period or more, the periods restart now."""
        self._running = False
        if (late := now - self._due) >= period:
            self.overruns += int(late / period)
            self.late += late
            self._due, self._last = now, now - period

    def restart(self) -> None:
        """Begin the periods now."""
        self._last = self._due = self._now()
        self._idle = self._running = False


class FastPace(_OwnPace):
    """Steps without waiting while there is work; then only heartbeats.

    Args:
        timing: returns the present values.
        now: monotonic clock [s].
    """

    def __init__(self, timing: Callable[[], Timing], now: Callable[[], float] = time.monotonic) -> None:
        self._timing, self._now = timing, now
        self.overruns, self.late = 0, 0.0
        self.restart()

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return 0 unless idle."""
        timing = self._timing()
        if pending or not settled or timing.ticking:
            return 0.0
        return max(0.0, self._last + timing.heartbeat - self._now()) if timing.heartbeat else None

    def begin(self) -> float:
        """Return one dt."""
        self._last = self._now()
        return self._timing().dt

    def restart(self) -> None:
        """Begin the heartbeat's interval now."""
        self._last = self._now()


class LockstepPace(_OwnPace):
    """Steps only when a command set is complete.

    Args:
        timing: returns the present values.
    """

    def __init__(self, timing: Callable[[], Timing]) -> None:
        self._timing = timing
        self.overruns, self.late = 0, 0.0

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Return 0 if a command set is complete, else None."""
        return 0.0 if pending else None

    def begin(self) -> float:
        """Return one dt."""
        return self._timing().dt

    def restart(self) -> None:
        """Do nothing: wall time has no effect."""


class ExternalPace:
    """Follows an external clock: one step of dt whenever the clock has advanced by dt, none while it stands still.

    While there is work, no dt is skipped or extended. A run thus depends only on the clock and the commands, and not on
    the speed of this machine. On a slow machine steps fall behind and count as overruns. While idle, a step covers all
    the elapsed time. If the clock goes back, or jumps ahead by more than `FARTHEST_JUMP`, its new time is adopted. No
    steps are made for the skipped time.

    Args:
        timing: returns the present values.
        now: returns the time of the clock [ns]; 0 before it is known.
        tell: receives a message about each jump of the clock.
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
        """Lead of the clock over the end of the step that began last [s]."""
        return 1e-9 * max(0, self._now() - self.moment - self._leapt) if self.moment else 0.0

    def jumped(self, ahead: int) -> None:
        """Record that the clock jumped ahead by this time [ns]; safe from any thread."""
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
        """Return one dt, or all the time that passed while idle."""
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
        """Return the number of whole dt by which the clock is ahead of the steps; adopt its time after a jump."""
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
