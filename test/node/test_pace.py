# SPDX-License-Identifier: Apache-2.0
"""When steps begin and how much time each covers, on a clock that the test turns."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gdfe_ros.node.pace import FastPace, LockstepPace, Timing, WallPace

TIMING = Timing(rate=10.0, dt=0.5, heartbeat=2.0, ticking=False)


class _Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_the_wall_pace_keeps_to_its_grid() -> None:
    """Begin steps a little late: the grid does not slip, each step covers dt, nothing is an overrun."""
    clock = _Clock()
    pace = WallPace(lambda: TIMING, clock)
    for step in range(5):
        clock.now = 100.0 + 0.1 * step + 0.03
        assert pace.delay(pending=True, settled=False) == 0.0
        assert pace.begin() == 0.5
    assert pace.delay(pending=True, settled=True) == pytest.approx(0.07)
    assert pace.overruns == 0


def test_a_long_step_is_an_overrun_and_the_next_begins_at_once() -> None:
    """Let a step last 0.35 s at 10 Hz: three periods are missed, simulation time gains one dt only."""
    clock = _Clock()
    pace = WallPace(lambda: TIMING, clock)
    pace.begin()
    clock.now += 0.45
    assert pace.delay(pending=True, settled=False) == 0.0
    assert pace.begin() == 0.5
    assert pace.overruns == 3
    assert pace.delay(pending=True, settled=False) == pytest.approx(0.1)


def test_an_idle_wall_pace_only_beats_and_then_catches_up() -> None:
    """Have nothing to do: wait for the heartbeat; the step after 1.3 s covers 13 periods and is no overrun."""
    clock = _Clock()
    pace = WallPace(lambda: TIMING, clock)
    pace.begin()
    assert pace.delay(pending=False, settled=True) == pytest.approx(2.0)
    clock.now += 1.3
    assert pace.delay(pending=True, settled=True) == 0.0
    assert pace.begin() == pytest.approx(13 * 0.5)
    assert pace.overruns == 0


def test_without_a_heartbeat_an_idle_pace_waits_for_an_event() -> None:
    """Set the heartbeat to 0: wall and fast wait without limit; a ticking clock goes on all the same."""
    silent = replace(TIMING, heartbeat=0.0)
    for kind in (WallPace, FastPace):
        pace = kind(lambda: silent, _Clock())
        pace.begin()
        assert pace.delay(pending=False, settled=True) is None
    pace = FastPace(lambda: replace(silent, ticking=True), _Clock())
    assert pace.delay(pending=False, settled=True) == 0.0


def test_a_pause_is_not_an_overrun() -> None:
    """Restart after 10 s: the grid begins anew."""
    clock = _Clock()
    pace = WallPace(lambda: TIMING, clock)
    pace.begin()
    clock.now += 10.0
    pace.restart()
    assert pace.begin() == 0.5
    assert pace.overruns == 0


def test_lockstep_steps_for_commands_only() -> None:
    """Ask with and without a command: whether the last step converged plays no part."""
    pace = LockstepPace(lambda: TIMING)
    assert pace.delay(pending=False, settled=False) is None
    assert pace.delay(pending=True, settled=True) == 0.0
    assert pace.begin() == 0.5
