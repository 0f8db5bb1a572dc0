# SPDX-License-Identifier: Apache-2.0
"""Stamps and frames of headers: those that the node publishes, and those that it accepts."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from gdfe_ros.node.messages import to_time
from gdfe_ros.recording.step import StepRecord
from gdfe_ros.simulation import Command
from gdfe_ros.testing import Simulator


class _Clock:
    """A /clock of another program, such as Gazebo or a bag."""

    def __init__(self, client: Any) -> None:
        qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
        self._client, self._publisher = client, client.node.create_publisher(Clock, "/clock", qos)
        client.wait(self._publisher.get_subscription_count)

    def show(self, milliseconds: int) -> None:
        self._publisher.publish(Clock(clock=Time(sec=milliseconds // 1000, nanosec=milliseconds % 1000 * 10**6)))


def _target(z: float, *, stamp: Time | None = None, frame: str = "") -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id, message.header.stamp = frame, stamp or Time()
    message.pose.position.z = z
    return message


def test_commands_are_taken_up_again_after_the_clock_went_back(client: Any, launch: Callable, coarse: dict) -> None:
    """After /clock jumps from 100 s back to 5 s, as for a repeated bag, stamps of 5 s are accepted."""
    launch(**coarse, clock="lockstep", use_sim_time=True)
    clock = _Clock(client)
    for step, (milliseconds, seconds) in enumerate(((100_000, 100), (5_000, 5)), start=1):
        clock.show(milliseconds)
        client.publish("handles/tip/target", _target(0.0))
        client.wait(lambda milliseconds=milliseconds: _shown(client, clock, milliseconds))
        count = len(client.records())
        client.publish("handles/tip/target", _target(0.01 * step, stamp=Time(sec=seconds)))
        client.wait(lambda count=count: len(client.records()) > count)
    assert client.status()["commands refused"] == "0"


def _shown(client: Any, clock: _Clock, milliseconds: int) -> bool:
    """Publish a time; return whether a step made since then is stamped with it."""
    clock.show(milliseconds)
    client.publish("handles/tip/target", _target(0.0))
    client.spin(0.05)
    return client.record().stamp == milliseconds * 10**6


@pytest.mark.parametrize("publish_clock", [False, True])
def test_headers_tell_the_nodes_time_and_records_both(
    client: Any, start: Callable, coarse: dict, publish_clock: bool
) -> None:
    """In lockstep, headers have the wall clock's stamp, or the simulation time if /clock is published; records both."""
    before = time.time_ns()
    start(**coarse, clock="lockstep", publish_clock=publish_clock, dt=0.25)
    client.target(0.1)
    client.wait_steps(2)
    record = client.record()
    assert record.stamp == 250_000_000 if publish_clock else before < record.stamp < time.time_ns()
    assert record.time == 0.25
    assert client.arrived("mesh", to_time(record.stamp)).header.frame_id == "base_link"


def test_steps_follow_anothers_clock(client: Any, start: Callable, coarse: dict) -> None:
    """With irregular times on /clock, steps come every dt, stamped on its grid, and none while it stands still."""
    start(**coarse, clock="external", use_sim_time=True, velocity_timeout=100.0, dt=0.02)
    clock = _Clock(client)
    # /clock is best effort: it is shown again until a step tells that it was seen.
    client.wait(lambda: clock.show(100_000) or _stamped(client, 100))
    twist = TwistStamped()
    twist.twist.linear.z = 0.1
    client.publish("handles/tip/velocity", twist)
    for now in (100_015, 100_050, 100_110, 100_111, 100_230):
        wanted = 100_000 + (now - 100_000) // 20 * 20
        client.wait(lambda now=now, wanted=wanted: _arrived(client, clock, now, wanted))
    moving = [record for record in client.records() if record.handles]
    # The first step covers what passed while nothing was commanded, as the velocity came; each other covers one dt.
    stamps = [record.stamp // 10**6 for record in moving]
    assert stamps == list(range(stamps[0], 100_221, 20))
    assert len(stamps) >= 6
    heights = [record.handles["tip"].translation[2] for record in moving]
    np.testing.assert_allclose(heights, 0.002 * np.arange(1, len(moving) + 1))
    count = client.status()["steps"]
    assert client.status()["steps"] == count
    client.wait(lambda: clock.show(5_000) or client.spin(0.05) or clock.show(5_100) or _is_at(client, 5_100))


def test_a_clock_that_jumps_ahead_is_not_made_up_for(client: Any, start: Callable) -> None:
    """After /clock jumps by 1000 s and to epoch time, a moving body continues at the new time; the log says so."""
    mesh = "mesh.bar.cells=[10, 1, 1]"
    process = start(scene="drop", scene_overrides=[mesh], clock="external", use_sim_time=True, dt=0.02)
    clock = _Clock(client)
    client.wait(lambda: clock.show(100_000) or _stamped(client, 100))
    for begin in (100_000, 1_100_000, 1_700_000_000_000):
        for now in range(begin, begin + 201, 20):
            clock.show(now)
            client.spin(0.05)
        client.wait(lambda begin=begin: client.record().stamp > begin * 10**6)
    told = client.status()
    assert 0.0 < float(told["simulation time [s]"]) < 1.0
    assert float(told["behind the clock [s]"]) < 0.1
    for began, ended in (("100.", "1100"), ("1100.", "1.7e+09")):
        assert re.search(rf"the clock jumped ahead from {re.escape(began)}\d* to {re.escape(ended)}", process.log)


def _arrived(client: Any, clock: _Clock, now: int, wanted: int) -> bool:
    """Publish a time; return whether the last step has the wanted stamp [ms]."""
    clock.show(now)
    client.spin(0.05)
    return wanted == 100_000 or _is_at(client, wanted)


def _stamped(client: Any, seconds: int) -> bool:
    """Return whether diagnostics stamped with this second of the clock have arrived."""
    client.spin(0.05)
    return any(message.header.stamp.sec == seconds for message in client.received["/diagnostics"])


def _is_at(client: Any, milliseconds: int) -> bool:
    return client.record().stamp == milliseconds * 10**6


def test_the_clock_that_is_followed_cannot_be_switched_off(client: Any, start: Callable, coarse: dict) -> None:
    """With clock external, use_sim_time is refused to be switched off while active; afterwards activate fails."""
    process = start(**coarse, clock="external", use_sim_time=True)
    client.wait(lambda: "active, clock external" in process.log)
    (refused,) = client.set(use_sim_time=False)
    assert not refused.successful
    assert refused.reason.startswith(
        "use_sim_time is needed by clock external and can be switched off while not active"
    )
    assert client.set(use_sim_time=True)[0].successful
    assert client.transition("deactivate")
    assert client.set(use_sim_time=False)[0].successful
    assert not client.transition("activate")
    assert "set use_sim_time true and publish_clock false" in process.log


def test_another_clock_must_be_there_to_be_followed(client: Any, start: Callable, coarse: dict) -> None:
    """With clock external and without use_sim_time, activate fails and names what is missing."""
    process = start(**coarse, clock="external")
    client.wait(lambda: "could not be activated" in process.log)
    assert "set use_sim_time true and publish_clock false" in process.log


def test_a_shortening_cable_reads_back_its_command() -> None:
    """The joint position of a tendon shortened by 3 and 5 mm is its command."""
    overrides = {"actuators.flexor.cable.command": "shortening"}
    with Simulator("tendon_finger", overrides=overrides) as simulator:
        states = [simulator.step(Command(actuators={"flexor": shortening})) for shortening in (0.003, 0.005)]
    found = [state.joints["flexor"][0] for state in states]
    np.testing.assert_allclose(found, [0.003, 0.005], atol=1e-6)
    assert states[1].joints["flexor"][1] == pytest.approx(0.2, rel=1e-2)
    assert isinstance(states[1].record, StepRecord)
