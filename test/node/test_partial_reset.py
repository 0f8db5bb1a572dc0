# SPDX-License-Identifier: Apache-2.0
"""Resets of commands, rigid bodies or the shape alone: everything else stays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped
from std_srvs.srv import Trigger

from gdfe_ros.constraints import Pose
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command, Simulation
from test.written import advance


def test_commands_go_back_to_rest_with_the_next_step(
    client: Any, start: Callable, coarse: dict, replays: Callable, tmp_path: Path
) -> None:
    """After a reset of the commands, a tip with a constant velocity returns, and the bag replays."""
    start(**coarse, velocity_timeout=1000.0, record=True, bag_path=str(tmp_path / "bag"))
    twist = TwistStamped()
    twist.twist.linear.z = 0.02
    client.publish("handles/tip/velocity", twist)
    client.wait(lambda: client.mesh()[:, 5].max() > 0.01)
    before = client.record().time
    client.trigger("reset_commands")
    client.wait(lambda: abs(client.mesh()[:, 5]).max() < 1e-4)
    assert client.record().time > before
    client.switch("record", False)
    replays(tmp_path / "bag")


def test_the_shape_goes_back_and_time_goes_on(client: Any, start: Callable, coarse: dict) -> None:
    """A reset of the shape makes a lifted bar undeformed, and time continues; a reset of missing bodies is refused."""
    start(**coarse)
    client.target(0.05)
    client.wait(lambda: client.mesh()[:, 5].max() > 0.049)
    client.status()
    before = client.record().time
    assert "at the rest shape, time" in client.trigger("reset_shape")
    client.wait(lambda: not client.mesh()[:, 3:].any())
    assert client.record().time >= before
    client.target(0.02)
    client.wait(lambda: abs(client.mesh()[:, 5].max() - 0.02) < 1e-5)
    assert "no rigid bodies" in client.call(Trigger, "reset_bodies", Trigger.Request()).message


def test_bodies_go_back_and_the_rest_goes_on(client: Any, launch: Callable, slab: Path) -> None:
    """A fallen box is put back by the service without velocity, and falls again."""
    launch(scene=str(slab), scene_overrides=["bodies.part.at=[0.05, 0, 0.061]"], clock="lockstep", dt=0.01)
    client.advance(5)
    assert client.trigger("reset_bodies") == "the next step puts back part"
    client.advance()
    client.wait(lambda: any(record.bodies for record in client.records()))
    record = next(record for record in client.records() if record.bodies)
    assert record.bodies == {"part": Pose()}
    assert record.time == pytest.approx(0.06)


def test_a_simulation_goes_back_to_its_shape_alone(slab: Path) -> None:
    """After a reset of the shape, a pressed slab is undeformed with its initial load, and the box and time stay."""
    simulation = Simulation(load_scene(slab))
    advance(simulation, Command(loads={"weight": 5.0}), dt=0.01, count=10)
    place = simulation.handle_pose("part")
    assert np.abs(simulation.positions - simulation.mesh.vertices).max() > 1e-5
    simulation.step(Command(bodies={"part": Pose((0.0, 0.0, 0.02))}), dt=0.005)
    place = simulation.handle_pose("part")
    simulation.reset_shape()
    np.testing.assert_array_equal(simulation.positions, simulation.mesh.vertices)
    np.testing.assert_allclose(simulation.handle_pose("part").translation, place.translation, atol=1e-12)
    assert simulation.time == pytest.approx(0.105)
    assert simulation.commands["weight"] == 1.0
    assert simulation.step(dt=0.005).converged
