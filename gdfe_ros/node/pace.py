# SPDX-License-Identifier: Apache-2.0
"""When the next step begins, and how much simulation time it covers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

FARTHEST_JUMP = 10.0
"""Farthest that another's clock may go ahead at once [s] for the steps in between to be made."""


class ClockMode(str, Enum):
    """What makes a step begin."""

    WALL = "wall"
    FAST = "fast"
    LOCKSTEP = "lockstep"
    EXTERNAL = "external"


@dataclass(frozen=True)
class Timing:
    """Values in force of the parameters that pace the steps.

    Attributes:
        rate: steps a second of wall time [Hz].
        dt: simulation time of a step [s].
        heartbeat: interval of steps while there is nothing to do [s]; 0: none.
        ticking: keep stepping while there is nothing to do.
    """

    rate: float
    dt: float
    heartbeat: float
    ticking: bool


class Pace(Protocol):
    """Decides when to step.

    Attributes:
        overruns: steps that should have begun while an earlier one was still running.
        late: how much later than due steps have ended, all together [s].
        moment: time on another's clock at the end of the step that began last [ns]; 0: no such clock is followed.
        behind: how far that clock is ahead of it [s]; 0 where none is followed.
    """

    overruns: int
    late: float
    moment: int
    behind: float

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Give the wall time to wait [s]: 0 to step now, None to wait for something to happen."""

    def begin(self) -> float:
        """Note that a step begins now and give the simulation time that it covers [s]."""

    def restart(self) -> None:
        """Forget the wall time that passed, e.g. in a pause."""


class _OwnPace:
    """A pace that follows no other clock, and so is never behind one."""

    moment, behind = 0, 0.0


class WallPace(_OwnPace):
    """Steps at a rate of wall time; while there is nothing to do, only heartbeats.

    A pause of n periods is one step of n dt, so that simulation time keeps up with the wall. A step that takes
    longer than its period is late, whatever comes after it: the periods that it missed are overruns, and simulation
    time falls behind by them.

    Args:
        timing: gives the values in force.
        now: monotonic clock [s].
    """

    def __init__(self, timing: Callable[[], Timing], now: Callable[[], float] = time.monotonic) -> None:
        self._timing, self._now = timing, now
        self.overruns, self.late = 0, 0.0
        self.restart()

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Wait for the grid of the rate, or for the heartbeat where nothing is to be done."""
        timing, now = self._timing(), self._now()
        if self._running:
            self._end(now, 1.0 / timing.rate)
        if pending or not settled or timing.ticking:
            return max(0.0, self._due - now)
        self._idle = True
        return max(0.0, self._last + timing.heartbeat - now) if timing.heartbeat else None

    def begin(self) -> float:
        """Advance the grid and count what was missed."""
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
        """Note that a step is over; where the next is overdue by a period or more, the grid begins anew."""
        self._running = False
        if (late := now - self._due) >= period:
            self.overruns += int(late / period)
            self.late += late
            self._due, self._last = now, now - period

    def restart(self) -> None:
        """Begin the grid now."""
        self._last = self._due = self._now()
        self._idle = self._running = False


class FastPace(_OwnPace):
    """Steps without waiting as long as there is something to do; then only heartbeats.

    Args:
        timing: gives the values in force.
        now: monotonic clock [s].
    """

    def __init__(self, timing: Callable[[], Timing], now: Callable[[], float] = time.monotonic) -> None:
        self._timing, self._now = timing, now
        self.overruns, self.late = 0, 0.0
        self.restart()

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Wait only where there is nothing to do."""
        timing = self._timing()
        if pending or not settled or timing.ticking:
            return 0.0
        return max(0.0, self._last + timing.heartbeat - self._now()) if timing.heartbeat else None

    def begin(self) -> float:
        """Cover one dt."""
        self._last = self._now()
        return self._timing().dt

    def restart(self) -> None:
        """Begin the heartbeat's interval now."""
        self._last = self._now()


class LockstepPace(_OwnPace):
    """Steps when a command set is there, never otherwise.

    Args:
        timing: gives the values in force.
    """

    def __init__(self, timing: Callable[[], Timing]) -> None:
        self._timing = timing
        self.overruns, self.late = 0, 0.0

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Wait for a command set, whatever the last step came to."""
        return 0.0 if pending else None

    def begin(self) -> float:
        """Cover one dt."""
        return self._timing().dt

    def restart(self) -> None:
        """Do nothing: wall time plays no part."""


class ExternalPace:
    """Steps as another's clock goes: one dt each time that the clock has gone on by one, none while it stands.

    While there is something to do, no dt is skipped and none is longer, so that a run follows from the clock and the
    commands, however fast this machine is; where it is too slow, steps fall behind and are counted as overruns. While
    there is nothing to do, a step covers all that has passed. When the clock goes back, or jumps ahead by more than
    `FARTHEST_JUMP` at once, its new time is gone on from: no step makes up for what was skipped.

    Args:
        timing: gives the values in force.
        now: gives the time of the clock [ns]; 0 before it is known.
        tell: takes the text of a jump.
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
        """How far the clock is ahead of the end of the step that began last [s]."""
        return 1e-9 * max(0, self._now() - self.moment - self._leapt) if self.moment else 0.0

    def jumped(self, ahead: int) -> None:
        """Note, in any thread, by how much the clock went ahead at once [ns]."""
        if ahead > round(1e9 * FARTHEST_JUMP) and self.moment:
            self._leapt += ahead

    def delay(self, *, pending: bool, settled: bool) -> float | None:
        """Step where a dt is due, or the heartbeat where nothing is to be done; else wait for the clock."""
        timing, due = self._timing(), self._due()
        if pending or not settled or timing.ticking:
            return 0.0 if due else None
        self._idle = True
        return 0.0 if due and timing.heartbeat and due * timing.dt >= timing.heartbeat else None

    def begin(self) -> float:
        """Cover one dt, or all that passed in idleness."""
        due = max(1, self._due())
        count = due if self._idle else 1
        self.overruns += due - 1 > 0 and not self._idle
        self._idle = False
        dt = self._timing().dt
        self.moment += round(1e9 * dt) * count
        return count * dt

    def restart(self) -> None:
        """Go on from the present time of the clock."""
        self.moment, self._leapt = self._now(), 0

    def _due(self) -> int:
        """Give the number of whole dt that the clock is ahead."""
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
    """Make the pace of a clock mode; ``now`` gives the time of the node's clock [ns], ``tell`` takes its jumps."""
    if mode is ClockMode.EXTERNAL:
        return ExternalPace(timing, now, tell)
    kinds = {ClockMode.WALL: WallPace, ClockMode.FAST: FastPace, ClockMode.LOCKSTEP: LockstepPace}
    return kinds[mode](timing)
