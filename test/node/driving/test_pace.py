# SPDX-License-Identifier: Apache-2.0
"""The start of steps and the time that each covers, on a simulated clock."""

from __future__ import annotations

import pytest

from gdfe_ros.node.driving.pace import ExternalPace, FastPace, LockstepPace, WallPace

VALUES = {"rate": 10.0, "dt": 0.5, "heartbeat": 2.0, "publish_clock": False}
EXTERNAL = {"dt": 0.01, "heartbeat": 0.0, "publish_clock": False}


class _Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> _Clock:
    """Give a simulated clock."""
    return _Clock()


@pytest.fixture
def pace(clock: _Clock) -> WallPace:
    """Give a pace at 10 Hz by the clock."""
    return WallPace(VALUES, clock)


def test_the_wall_pace_keeps_to_its_grid(clock: _Clock, pace: WallPace) -> None:
    """Steps that start a little late do not shift the grid, cover dt each, and are no overruns."""
    for step in range(5):
        clock.now = 100.0 + 0.1 * step + 0.03
        assert pace.delay(pending=True, settled=False) == 0.0
        assert pace.begin() == 0.5
    assert pace.delay(pending=True, settled=True) == pytest.approx(0.07)
    assert pace.overruns == 0


def test_a_long_step_is_an_overrun_and_the_next_begins_at_once(clock: _Clock, pace: WallPace) -> None:
    """A step at 10 Hz that lasts 0.45 s misses three periods; the next starts at once, and covers one dt only."""
    pace.begin()
    clock.now += 0.45
    assert pace.delay(pending=True, settled=False) == 0.0
    assert pace.begin() == 0.5
    assert pace.overruns == 3
    assert pace.delay(pending=True, settled=False) == pytest.approx(0.1)


def test_an_idle_wall_pace_only_beats_and_then_catches_up(clock: _Clock, pace: WallPace) -> None:
    """An idle pace waits for the heartbeat; a step after 1.3 s covers 13 periods and is no overrun."""
    pace.begin()
    assert pace.delay(pending=False, settled=True) == pytest.approx(2.0)
    clock.now += 1.3
    assert pace.delay(pending=True, settled=True) == 0.0
    assert pace.begin() == pytest.approx(13 * 0.5)
    assert pace.overruns == 0


def test_time_in_which_the_process_stood_still_is_skipped(clock: _Clock, pace: WallPace) -> None:
    """After 4 s without a heartbeat of 2 s, as by SIGSTOP, a step covers 2 s; the rest counts as late.

    Before, the simulation made up for the whole time in few long steps.
    """
    pace.begin()
    assert pace.delay(pending=False, settled=True) == pytest.approx(2.0)
    clock.now += 6.0
    assert pace.delay(pending=False, settled=True) == 0.0
    assert pace.begin() == pytest.approx(20 * 0.5)
    assert (pace.overruns, pace.late) == (40, pytest.approx(4.0))
    clock.now += 0.1
    assert pace.delay(pending=True, settled=False) == 0.0
    assert pace.begin() == 0.5


@pytest.mark.parametrize("before", [30.0, 0.0])
@pytest.mark.parametrize("kind", [WallPace, FastPace])
def test_a_changed_heartbeat_counts_from_its_change_on(clock: _Clock, kind: type, before: float) -> None:
    """After 10 idle seconds, the next step is one new heartbeat away, covers the whole time, and is no overrun."""
    values = VALUES | {"heartbeat": before}
    pace = kind(values, clock)
    pace.begin()
    pace.delay(pending=False, settled=True)
    clock.now += 10.0
    values["heartbeat"] = 0.2
    assert pace.delay(pending=False, settled=True) == pytest.approx(0.2)
    clock.now += 0.2
    assert pace.delay(pending=False, settled=True) == pytest.approx(0.0, abs=1e-9)
    assert pace.begin() == (pytest.approx(102 * 0.5) if kind is WallPace else 0.5)
    assert pace.overruns == 0
    values["heartbeat"] = 0.0
    assert pace.delay(pending=False, settled=True) is None


def test_a_changed_rate_ends_the_period_that_has_begun(clock: _Clock) -> None:
    """At 0.05 Hz the next step is 20 s away; 5 s later, at 50 Hz, 0.02 s, and without an overrun."""
    values = VALUES | {"rate": 0.05}
    pace = WallPace(values, clock)
    pace.begin()
    assert pace.delay(pending=True, settled=False) == pytest.approx(20.0)
    clock.now += 5.0
    values["rate"] = 50.0
    for _ in range(3):
        assert pace.delay(pending=True, settled=False) == pytest.approx(0.02)
        clock.now += 0.02
        assert pace.begin() == 0.5
    assert pace.overruns == 0


def test_without_a_heartbeat_an_idle_pace_waits_for_an_event() -> None:
    """With heartbeat 0, idle wall and fast paces wait without limit; a ticking clock continues."""
    silent = VALUES | {"heartbeat": 0.0}
    for kind in (WallPace, FastPace):
        pace = kind(silent, _Clock())
        pace.begin()
        assert pace.delay(pending=False, settled=True) is None
    pace = FastPace(silent | {"publish_clock": True}, _Clock())
    assert pace.delay(pending=False, settled=True) == 0.0


def test_rest_does_not_hide_that_a_step_was_late(clock: _Clock, pace: WallPace) -> None:
    """Each step of 0.35 s of a settled body is late by 0.25 s, also if the next command comes 20 ms later."""
    for step in range(4):
        assert pace.begin() == 0.5
        clock.now += 0.35
        assert pace.delay(pending=False, settled=True) == pytest.approx(1.9)
        assert (pace.overruns, pace.late) == (2 * (step + 1), pytest.approx(0.25 * (step + 1)))
        clock.now += 0.02
        assert pace.delay(pending=True, settled=True) == 0.0
    clock.now += 0.5
    assert pace.begin() == pytest.approx(6 * 0.5)


def test_a_pause_is_not_an_overrun(clock: _Clock, pace: WallPace) -> None:
    """A restart after 10 s starts a new grid and is no overrun."""
    pace.begin()
    clock.now += 10.0
    pace.restart()
    assert pace.begin() == 0.5
    assert pace.overruns == 0


def test_lockstep_steps_for_commands_only() -> None:
    """In lockstep a step starts only for a command, whether or not the last step converged."""
    pace = LockstepPace(VALUES)
    assert pace.delay(pending=False, settled=False) is None
    assert pace.delay(pending=True, settled=True) == 0.0
    assert pace.begin() == 0.5


@pytest.mark.parametrize("ahead", [1000.0, 1.7e9])
def test_a_clock_that_jumps_ahead_is_gone_on_from(ahead: float) -> None:
    """A jump of the clock far ahead is reported once and skipped; steps continue from there."""
    clock, told = [5 * 10**9], []
    pace = ExternalPace(EXTERNAL, lambda: clock[0], told.append)
    assert pace.delay(pending=True, settled=False) is None
    clock[0] += 10**7
    assert pace.delay(pending=True, settled=False) == 0.0
    pace.begin()
    jump = round(ahead * 1e9)
    clock[0] += jump
    pace.record_jump(jump)
    assert pace.behind == 0.0
    assert pace.delay(pending=True, settled=False) is None
    (text,) = told
    assert text.startswith(
        f"the clock jumped ahead from 5.01 to {5.01 + ahead:.9g} s: the simulation goes on from there"
    )
    clock[0] += 10**7
    assert pace.delay(pending=True, settled=False) == 0.0
    assert pace.begin() == 0.01
    assert pace.moment == clock[0]


def test_a_clock_that_goes_on_is_caught_up_with() -> None:
    """After the clock advances by 5 s without a jump, all steps are due, and the time behind the clock is known."""
    clock, told = [5 * 10**9], []
    pace = ExternalPace(EXTERNAL, lambda: clock[0], told.append)
    clock[0] += 5 * 10**9
    pace.record_jump(5 * 10**9)
    assert pace.behind == pytest.approx(5.0)
    assert pace.delay(pending=True, settled=False) == 0.0
    pace.begin()
    assert pace.behind == pytest.approx(4.99)
    assert not told


def test_a_clock_that_goes_back_is_told() -> None:
    """If the clock goes back, steps continue from there, with a message."""
    clock, told = [5 * 10**9], []
    pace = ExternalPace(EXTERNAL, lambda: clock[0], told.append)
    clock[0] = 10**9
    assert pace.delay(pending=True, settled=False) is None
    assert told[0].startswith("the clock jumped back from 5 to 1 s")
