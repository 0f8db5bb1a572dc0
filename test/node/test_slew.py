# SPDX-License-Identifier: Apache-2.0
"""Commands of actuators that are too far for a step: followed at a rate that steps keep up with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from gdfe_ros.node.slew import Slew
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command


def test_a_command_crosses_the_range_in_its_time() -> None:
    """Command 20 N of a range of 20 N at once: 2 N a step of 0.05 s in 0.5 s; without a time all at once."""
    slew = Slew(load_scene("tendon_finger").actuators)
    present, command = {"flexor": 0.0, "extensor": 0.0}, Command(actuators={"flexor": 20.0})
    seen = []
    while command.actuators or slew.moving:
        given = slew.limit(command, present, dt=0.05, slew_time=0.5)
        present |= given.actuators
        seen.append(present["flexor"])
        slew.note(converged=True, cut=False)
        command = Command()
    np.testing.assert_allclose(seen, np.arange(2.0, 21.0, 2.0))
    assert slew.limit(Command(actuators={"flexor": 0.0}), present, dt=0.05, slew_time=0.0).actuators == {"flexor": 0.0}
    assert not slew.moving


def test_steps_that_do_not_converge_slow_it_down() -> None:
    """Let steps fail: the command stays, then goes half of the way back, the rate is halved, and grows."""
    slew = Slew(load_scene("tendon_finger").actuators)
    present, seen = {"flexor": 0.0, "extensor": 0.0}, []
    command = Command(actuators={"flexor": 20.0})
    for converged in (True, False, False, False, True, True, True):
        present |= slew.limit(command, present, dt=0.05, slew_time=0.5).actuators
        command = Command()
        slew.note(converged=converged, cut=not converged)
        seen.append(present["flexor"])
    np.testing.assert_allclose(seen, [2.0, 4.0, 4.0, 4.0, 3.0, 4.2, 5.64])
    slew.clear()
    assert slew.limit(Command(), present, dt=0.05, slew_time=0.5).actuators == {}


def test_an_edge_of_stability_is_passed() -> None:
    """Let every step from 6 to 8 N be cut: the command goes back, then on with growing steps, and gets to its goal."""
    slew, present = Slew(load_scene("tendon_finger").actuators), {"flexor": 0.0, "extensor": 0.0}
    command = Command(actuators={"flexor": 15.0})
    for _ in range(200):
        present |= slew.limit(command, present, dt=0.02, slew_time=0.5).actuators
        command = Command()
        bad = 6.0 < present["flexor"] < 8.0
        slew.note(converged=not bad, cut=bad)
    assert present["flexor"] == 15.0
    assert not slew.moving


def test_a_failure_that_time_does_not_mend_slows_nothing() -> None:
    """Let a step fail that no deadline cut: the command goes on at its full rate."""
    slew, present = Slew(load_scene("tendon_finger").actuators), {"flexor": 0.0, "extensor": 0.0}
    for command in (Command(actuators={"flexor": 15.0}), Command()):
        present |= slew.limit(command, present, dt=0.02, slew_time=0.5).actuators
        slew.note(converged=False, cut=False)
    assert present["flexor"] == pytest.approx(1.6)


@pytest.mark.parametrize("clock", ["wall", "lockstep"])
def test_a_hurried_node_steps_as_far_as_it_converges(client: Any, start: Callable, clock: str) -> None:
    """Pull the flexor to 5 N, half a second for a step: under the wall clock by and by, in lockstep at once."""
    start(scene="tendon_finger", clock=clock, dt=0.02, rate=50.0, deadline=0.5 if clock == "wall" else 0.0)
    client.publish("actuation", JointState(name=["flexor"], effort=[5.0]))
    records = lambda: [record for record in client.records() if record.actuators]  # noqa: E731
    if clock == "lockstep":
        client.wait(records)
        assert records()[0].actuators == {"flexor": 5.0}
        return
    client.wait(lambda: "flexor at" in client.diagnostics().get("on their way", ""))
    client.wait(lambda: records() and records()[-1].actuators["flexor"] == 5.0)
    client.wait(lambda: "on their way" not in client.diagnostics())
    pulled = np.array([record.actuators["flexor"] for record in records()])
    assert (np.diff(pulled) <= 0.8 + 1e-9).all()
    assert np.mean([record.converged for record in records()]) > 0.5
