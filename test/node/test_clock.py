# SPDX-License-Identifier: Apache-2.0
"""Clocks: wall, fast and lockstep; /clock for other nodes; commands over time; idle nodes."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped
from rclpy.parameter import Parameter

from gdfe_ros.analysis.bag_run import BagRun
from test.node.meter import read_processor


def _twist(client: Any, *, z: float = 0.0, turn: float = 0.0) -> None:
    message = TwistStamped()
    message.twist.linear.z, message.twist.angular.x = z, turn
    client.publish("handles/tip/velocity", message)


def test_the_wall_clock_keeps_real_time(client: Any, start: Callable, coarse: dict) -> None:
    """At 50 Hz, simulation time is never ahead of wall time, and behind it only by the counted overruns.

    A value was read at some moment between its stamp and its arrival, as each process may wait for the processor.
    """
    start(**coarse, rate=50.0, dt=0.02, velocity_timeout=1000.0)
    _twist(client, z=0.0075)
    client.wait(lambda: any(record.handles for record in client.records()))
    readings = [_reading(client)]

    def keeps_up() -> bool:
        readings.append(_reading(client))
        first, last = np.array(readings[-2:])
        # A step may be late without being counted yet: on a busy machine not every second tells.
        return last[0] - first[0] + 2.0 * 0.02 * (last[1] - first[1]) > last[2] - first[3] - 0.06

    while len(readings) < 4:
        client.wait(keeps_up)
    simulated, _, stamps, arrivals = np.array(readings).T
    assert (np.diff(simulated) < arrivals[1:] - stamps[:-1] + 0.06).all(), readings
    moving = [record for record in client.records() if record.handles]
    steps, times = np.array([(record.step, record.time) for record in moving]).T
    np.testing.assert_allclose(np.diff(times), 0.02 * np.diff(steps))
    heights = [record.handles["tip"].translation[2] for record in moving]
    np.testing.assert_allclose(np.diff(heights), 0.0075 * np.diff(times))


def _reading(client: Any) -> tuple[float, float, float, float]:
    """Return simulation time [s], overruns, stamp [s] and arrival time [s] of the next diagnostics."""
    values = client.diagnostics()
    stamp = client.last("/diagnostics").header.stamp
    read = stamp.sec + 1e-9 * stamp.nanosec
    return float(values["simulation time [s]"]), float(values["overruns"]), read, time.time()


def _idle(client: Any, start: Callable, clock: str, *, paused: bool, seconds: float) -> tuple[float, int, float]:
    """Return the share of a core, the steps and the time [s] of a node that gets no commands after ten steps.

    The number of steps is the node's own count, because an earlier message may arrive late.
    """
    process, steps = start(clock=clock), lambda: int(client.diagnostics()["steps"])
    for number in range(1, 11):
        client.target(1e-3 * number)
        client.spin(0.1)
    client.wait_taken(10)
    if paused:
        client.switch("pause", True)
    client.wait(lambda: all(steps() + 2 >= steps() for _ in range(3)))  # two heartbeats may fall between two reports
    began, count, before = time.monotonic(), steps(), read_processor(process.pid)
    client.spin(seconds)
    spent, made = read_processor(process.pid).since(before).total, steps() - count
    elapsed = time.monotonic() - began
    return spent / elapsed, made, elapsed


IDLE = [("lockstep", False, 0), ("wall", True, 0), ("wall", False, 1)]


@pytest.mark.parametrize(("clock", "paused", "beats"), IDLE)
def test_an_idle_node_beats_once_a_second_at_most(
    client: Any, start: Callable, clock: str, paused: bool, beats: int
) -> None:
    """An idle node makes no step in lockstep or paused, and with the wall clock a heartbeat each second."""
    _, steps, elapsed = _idle(client, start, clock, paused=paused, seconds=3.0)
    assert beats <= steps <= beats * (elapsed + 1.0)


@pytest.mark.bench
@pytest.mark.parametrize(("clock", "paused"), [(clock, paused) for clock, paused, _ in IDLE])
def test_an_idle_node_takes_next_to_nothing_of_a_core(client: Any, start: Callable, clock: str, paused: bool) -> None:
    """An idle node uses less than 1 % of a core over four seconds."""
    assert _idle(client, start, clock, paused=paused, seconds=4.0)[0] < 0.01


def test_fast_steps_until_the_motion_is_over(client: Any, start: Callable, coarse: dict, tmp_path: Path) -> None:
    """With the fast clock, time stops one step after a turn that lasts 2 s of simulation time."""
    bag = tmp_path / "bag"
    process = start(**coarse, clock="fast", heartbeat=0.0, velocity_timeout=2.0, record=True, bag_path=str(bag))
    _twist(client, turn=2.0)
    client.wait(lambda: int(client.diagnostics()["steps"]) >= 201)
    client.wait(lambda: client.diagnostics()["steps"] == client.diagnostics()["steps"])
    process.stop()
    records = BagRun(bag).records
    assert records[-1].time == pytest.approx(2.01, abs=0.011)
    turns = [record.handles["tip"].rotation[0] for record in records if record.handles]
    np.testing.assert_allclose(turns, 0.02 * np.arange(1, len(turns) + 1), atol=1e-9)
    assert turns[-1] > np.pi


def test_lockstep_loses_no_command(client: Any, start: Callable, coarse: dict, tmp_path: Path) -> None:
    """In lockstep, 500 commands sent at once give 500 steps, each with its own command, in order."""
    process = start(**coarse, clock="lockstep", record=True, bag_path=str(tmp_path / "bag"))
    heights = 2e-5 * np.arange(1, 501)
    for z in heights:
        client.target(z)
    client.wait(lambda: client.diagnostics()["steps"] == "501")
    process.stop()
    records = BagRun(tmp_path / "bag").records
    assert [record.handles["tip"].translation[2] for record in records[1:]] == heights.tolist()
    assert records[-1].time == pytest.approx(5.0)


def test_a_command_set_makes_one_step(client: Any, start: Callable, coarse: dict) -> None:
    """With a command set of a target and a velocity, a step starts when both have arrived."""
    start(**coarse, clock="lockstep", command_set=["handles/tip/target", "handles/tip/velocity"])
    client.target(0.01)
    client.target(0.02)
    client.wait_taken(2)
    assert client.diagnostics()["steps"] == "1"
    _twist(client, z=1.0)
    client.wait_taken(3)
    client.wait_steps(2)
    assert client.diagnostics()["steps"] == "2"


def test_an_unknown_input_in_the_command_set_is_said(client: Any, start: Callable, coarse: dict) -> None:
    """An unknown input in the command set makes activate fail with a list of the known ones."""
    process = start(**coarse, clock="lockstep", command_set=["handles/tipp/target"])
    client.wait(lambda: "could not be activated" in process.log)
    assert "handles/tip/target" in process.log


def test_clients_with_use_sim_time_follow_the_clock(client: Any, start: Callable, coarse: dict, ros: Any) -> None:
    """In lockstep with /clock published, a node with use_sim_time has the time of the last step."""
    follower = ros.node("follower", parameter_overrides=[Parameter("use_sim_time", value=True)])
    start(**coarse, clock="lockstep", publish_clock=True, dt=0.25)
    times = iter(0.25 * np.arange(1, 1000))

    def follows() -> bool:
        """Make a step; return whether the follower has its time.

        /clock is best effort: a subscriber that is not known yet, or busy, does not get a message a second time.
        """
        now = next(times)
        client.target(0.01 * now)
        client.wait(lambda: client.record().time == now)
        client.spin(0.1)
        found = follower.get_clock().now().nanoseconds
        assert found % 250_000_000 == 0
        assert found <= 1e9 * now
        return found == 1e9 * now

    for _ in range(2):
        client.wait(follows)


def test_a_changed_rate_and_a_changed_heartbeat_act_at_once(client: Any, start: Callable, coarse: dict) -> None:
    """While a node waits for half an hour, or for 100 s, a new heartbeat, or a new rate, makes it step at once."""
    start(**coarse, rate=0.01, dt=0.02, heartbeat=1800.0, velocity_timeout=1000.0)
    client.wait(lambda: client.received["mesh"])
    assert client.set(heartbeat=0.1)[0].successful
    client.wait(lambda: len(client.records()) > 3, seconds=60.0)
    assert client.set(heartbeat=0.0)[0].successful
    _twist(client, z=0.001)
    client.wait_taken(1)
    assert client.set(rate=50.0)[0].successful
    client.wait(lambda: len([record for record in client.records() if record.handles]) > 20, seconds=60.0)


def test_a_ticking_wall_clock_goes_on_without_commands(client: Any, start: Callable, coarse: dict) -> None:
    """With the wall clock and /clock published, steps of dt continue without commands."""
    start(**coarse, publish_clock=True, heartbeat=0.0)
    client.wait(lambda: len(client.records()) >= 30)
    records = client.records()[1:30]
    steps, times = np.array([(record.step, record.time) for record in records]).T
    np.testing.assert_allclose(np.diff(times), 0.01 * np.diff(steps))
    assert not any(record.handles for record in records)
    # In one second, whoever waits for the processor may shift the factor.
    client.wait(lambda: 0.0 < float(client.diagnostics()["real-time factor"]) < 1.5)


def test_overruns_are_reported(client: Any, start: Callable, coarse: dict) -> None:
    """At 10 kHz, steps are too slow, and diagnostics count the overruns and warn."""
    start(**coarse, rate=1e4, dt=1e-3, velocity_timeout=8.0)
    _twist(client, z=0.005)
    client.wait(lambda: "overruns since the last report" in client.diagnostics()["message"])
    client.wait(lambda: int(client.diagnostics()["overruns"]) > 100)
    assert float(client.diagnostics()["real-time factor"]) < 10.0


def test_a_body_that_settles_does_not_hide_lateness(client: Any, start: Callable) -> None:
    """With a command after each step of a large bar at 1 kHz, diagnostics have rates and lateness, and warn."""
    start(scene="bend5", rate=1e3, dt=1e-3)
    heights = iter(np.linspace(0.0, 0.03, 4000)[1:])

    def late() -> dict[str, str] | None:
        count = len(client.records())
        client.target(next(heights))
        client.wait(lambda: len(client.records()) > count)
        values = {pair.key: pair.value for part in client.last("/diagnostics").status for pair in part.values}
        return values if int(values.get("overruns", 0)) > 100 else None

    values = client.wait(late)
    assert values["rate asked [Hz]"] == "1000"
    assert 0.0 < float(values["rate reached [Hz]"]) < 600.0
    assert 1e-3 < float(values["late per step [s]"]) < 1.0
    client.target(0.0)
    client.wait(lambda: "rate asked [Hz] 1000, rate reached" in client.last("/diagnostics").status[0].message)


def test_figures_of_other_clocks_are_told(client: Any, start: Callable, coarse: dict) -> None:
    """In lockstep, diagnostics report what a step waits for, and no lateness."""
    start(**coarse, clock="lockstep")
    values = client.diagnostics()
    assert values["rate asked [Hz]"] == "one step for each command set"
    assert float(values["rate reached [Hz]"]) < 10.0
    assert values["late per step [s]"] == "0"


def test_a_deadline_cuts_a_step_and_the_next_go_on(client: Any, start: Callable) -> None:
    """With a deadline of 2 ms, a step of a large motion is cut and marked, and later steps reach the target."""
    start(scene="bend5", deadline=0.002)
    client.target(0.2)
    client.wait(lambda: any(record.cut for record in client.records()))
    client.wait(lambda: client.record().converged and client.record().time > 0.0)
    client.wait(lambda: client.mesh()[:, 5].max() == pytest.approx(0.2, abs=1e-3))
    assert np.isfinite(client.meshes()).all()
