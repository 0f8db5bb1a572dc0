# SPDX-License-Identifier: Apache-2.0
"""Replays through a real node: the commands of each step are sent over topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.cli import main
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError, RecordingError
from gdfe_ros.node.messages import pose_stamped
from gdfe_ros.recording.step import Begin
from gdfe_ros.simulation import Command
from gdfe_ros.testing import NodeProcess, Simulator
from gdfe_ros.testing.client import LONGEST_WAIT, NodeConnection
from gdfe_ros.testing.node_replay import NodeReplay

COARSE = {"mesh.bar.cells": "[20, 2, 2]", "solver.tolerance": "1e-8"}


def _turned(height: float) -> PoseStamped:
    return pose_stamped(Header(), Pose((0.0, 0.0, height), (0.3 * height, 2.0 * height, -height)))


@pytest.mark.exact("the node's process shifts nothing")
@pytest.mark.parametrize("deadline", [0.0, 0.001])
def test_a_run_under_the_wall_clock_replays(tmp_path: Path, capfd: Any, replays: Callable, deadline: float) -> None:
    """A run at 100 Hz, with and without a deadline that cuts solves, replays with the same bits, also by a node."""
    parameters = {"clock": "wall", "rate": 100.0, "deadline": deadline, "command_set": [""]}
    with Simulator("bend5", overrides=COARSE, parameters=parameters, bag=tmp_path / "bag") as simulator:
        for z in np.linspace(0.005, 0.1, 20):
            pose = Pose((0.0, 0.0, float(z)), (0.0, 3.0 * float(z), float(z)))
            simulator.step(Command(handles={"tip": pose}))
    replays(tmp_path / "bag", node=True)
    cut = [record.cut for record in BagRun(tmp_path / "bag").records[:-1]]  # the end of the run may cut the last one
    assert sum(cut) > 5 if deadline else not any(cut)
    assert len(cut) >= 19
    assert main(["replay", str(tmp_path / "bag"), "--ros", "--set", "materials.e40.young=41e3"]) == 1
    assert "first divergent stamp" in capfd.readouterr().out


def test_a_bag_begun_in_the_middle_replays(tmp_path: Path, replays: Callable) -> None:
    """A bag from a deformed state on replays, with velocities, steps without a command, another dt and a reset."""
    topics = {"handles/tip/target": PoseStamped, "handles/tip/velocity": TwistStamped}
    overrides = [f"{key}={value}" for key, value in COARSE.items()]
    parameters = {"scene": "bend5", "scene_overrides": overrides, "clock": "lockstep"}
    with _linked("/begun", topics, velocity_timeout=0.02, **parameters) as (process, link):
        _command(link, "handles/tip/target", _turned(0.03))
        link.transition("deactivate")
        link.set(record=True, bag_path=str(tmp_path / "bag"))
        _activate(link)
        velocity = TwistStamped()
        velocity.twist.linear.z, velocity.twist.angular.y = 0.4, 1.1
        _command(link, "handles/tip/velocity", velocity)
        made = link.step
        for dt in (0.01, 0.004, 0.004, 0.03, 0.03):
            link.set(dt=dt)
            link.trigger("step")
        link.wait_for_step(made + 5)
        link.trigger("reset")
        link.wait_for_step(made + 6)
        _command(link, "handles/tip/target", _turned(0.05))
        assert process.stop() == 0
    replays(tmp_path / "bag", node=True)
    records = BagRun(tmp_path / "bag").records
    assert records[0].begin is Begin.LOADED
    assert [record.begin for record in records[1:]].count(Begin.REST) == 1
    assert any(not record.handles for record in records[1:7])
    with pytest.raises(RecordingError, match="begins in the middle"):
        Replay(BagRun(tmp_path / "bag"), overrides={"solver.tolerance": 1e-6})


def test_a_turn_beyond_pi_is_not_replayed_by_messages(tmp_path: Path) -> None:
    """A step in which a velocity turned a handle by 4 rad is refused, because a quaternion would turn it back."""
    overrides, velocity = [f"{key}={value}" for key, value in COARSE.items()], TwistStamped()
    velocity.twist.angular.x = 400.0
    parameters = {"scene": "bend5", "scene_overrides": overrides, "clock": "lockstep", "record": True}
    topics = {"handles/tip/velocity": TwistStamped}
    with _linked("/turned", topics, **parameters, bag_path=str(tmp_path / "bag")) as (process, link):
        _command(link, "handles/tip/velocity", velocity)
        assert process.stop() == 0
    with pytest.raises(CommandError, match=r"can only be replayed without --ros: handle 'tip' .* turn by 4 rad"):
        NodeReplay(BagRun(tmp_path / "bag"))


def test_actuators_commanded_one_at_a_time_replay(tmp_path: Path, replays: Callable) -> None:
    """Two cables commanded in turn replay: each step has the command of one, in newtons."""
    bag = tmp_path / "bag"
    parameters = {"scene": "tendon_finger", "clock": "lockstep", "record": True}
    with _linked("/pulled", {"actuation": JointState}, **parameters, bag_path=str(bag)) as (process, link):
        for cable, tension in (("flexor", 0.3), ("extensor", 0.2), ("flexor", 0.0)):
            _command(link, "actuation", JointState(name=[cable], position=[float("nan")], effort=[tension]))
        assert process.stop() == 0
    replays(bag, node=True)
    assert [len(record.actuators) for record in BagRun(bag).records] == [0, 1, 1, 1]


@contextmanager
def _linked(namespace: str, topics: dict[str, type], **parameters: Any) -> Iterator[tuple[NodeProcess, NodeConnection]]:
    """Give an active node and a connection that publishes on its topics."""
    with (
        NodeProcess({**parameters, "autostart": False}, namespace=namespace) as process,
        NodeConnection(process, f"{namespace}/gdfe_sim", topics, patience=LONGEST_WAIT) as link,
    ):
        link.meet()
        link.transition("configure")
        link.await_listeners()
        _activate(link)
        yield process, link


def _activate(link: NodeConnection) -> None:
    """Activate, and wait for the state published then, which would otherwise be taken for a commanded step."""
    count = link.step + 1
    link.transition("activate")
    link.wait_for_step(count)


def _command(link: NodeConnection, topic: str, message: Any) -> None:
    """Publish and wait for the step that consumes it."""
    count = link.step + 1
    link.publish({topic: message})
    link.wait_for_step(count)
