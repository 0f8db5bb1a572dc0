# SPDX-License-Identifier: Apache-2.0
"""An arm in a node: joint commands, states, frames, trajectories, bags."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.errors import CommandError
from gdfe_ros.testing import Simulator
from test.arms.conftest import SCENE, TWO_LINKS
from test.node.conftest import Follower, Tree, in_root

_LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def held_block(tmp_path: Path) -> Path:
    """Write the scene of a soft block with dynamics at the end of two links; return its path."""
    (tmp_path / "two.urdf").write_text(TWO_LINKS)
    path = tmp_path / "held_block.yaml"
    path.write_text(SCENE.format(urdf="two.urdf") + "dynamics: {step: 0.01}\n")
    return path


@pytest.mark.parametrize(
    "springs", ["", "compliance: {lift: {stiffness: 200, damping: 2}}, "], ids=["rigid", "yielding"]
)
def test_joints_are_commanded_and_reported(held_block: Path, replays: Callable, tmp_path: Path, springs: str) -> None:
    """Joint commands in lockstep give the library's states bit for bit, and the bag replays with equal efforts."""
    held_block.write_text(held_block.read_text().replace("flange: tip, ", f"flange: tip, {springs}"))
    simulation, steps = Simulation(load_scene(held_block)), []
    commands = [Command(joints={"lift": 1.5}), Command(), Command(joints={"bend": 0.2}), Command()]
    with Simulator(held_block, bag=tmp_path / "bag") as simulator:
        for command in commands:
            steps.append(simulator.step(command))
            simulation.step(command, dt=0.01)
            expected = simulation.joint_states()
            for name, (position, velocity, effort) in steps[-1].joints.items():
                reading = expected[name]
                assert (position, velocity, effort) == (reading.position, reading.velocity, reading.effort)
        with pytest.raises(CommandError, match="allowed: -2 to 2 rad"):
            simulator.step(Command(joints={"lift": 2.1}))
    assert steps[0].record.joints["lift"] == 1.5
    assert list(steps[0].joints) == ["lift", "bend"]
    replays(tmp_path / "bag", node=True)


def test_a_node_tells_of_the_arm(client: Any, start: Callable, tree: Tree, held_block: Path) -> None:
    """The node publishes the URDF and the frames of all links, and refuses wrong joint commands with reasons."""
    told: list[str] = []
    topic = "/gdfe_sim/arms/arm/robot_description"
    client.node.create_subscription(String, topic, lambda message: told.append(message.data), _LATCHED)
    start(scene=str(held_block), clock="fast", heartbeat=0.0, dt=0.01)
    client.wait(lambda: told and "tip" in tree.heard)
    assert told[0].startswith("<robot")
    assert in_root(tree.heard, "tip")[0][[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-12)
    client.publish("joint_command", JointState(name=["lift"], position=[0.0]))
    client.wait(lambda: in_root(tree.heard, "tip")[0][2] == pytest.approx(0.4, abs=0.3))
    client.publish("joint_command", JointState(name=["lever"], position=[0.0]))
    client.publish("joint_command", JointState(name=["lift"], position=[3.0]))
    client.publish("joint_command", JointState(name=["lift", "bend"], position=[0.1]))
    client.publish("handles/wrist/target", PoseStamped())
    client.wait(lambda: client.diagnostics().get("commands refused") == "4")


def test_an_arm_goes_back_at_once(client: Any, start: Callable, held_block: Path) -> None:
    """The service puts the joints back between two steps; time goes on, and the next command starts from there."""
    start(scene=str(held_block), clock="fast", heartbeat=0.0, dt=0.01)
    client.publish("joint_command", JointState(name=["lift"], position=[1.0]))
    client.wait(lambda: abs(client.mesh()[:, 5]).max() > 0.2)
    before = client.record().time
    client.trigger("reset_arms")
    client.wait(lambda: abs(client.mesh()[:, 5]).max() < 0.05)
    assert client.record().time >= before


def test_what_is_cut_is_told(client: Any, launch: Callable, held_block: Path) -> None:
    """After a jump, /diagnostics reports limited velocity and acceleration, and an effort that is too large."""
    limits = "arm.limits={bend: {effort: 0.1}}"
    launch(scene=str(held_block), clock="wall", rate=20.0, dt=0.01, scene_overrides=[limits])
    client.publish("joint_command", JointState(name=["lift"], position=[-1.9]))
    wanted, told = ("lift: velocity cut to its limit", "above its limit 0.1"), set()

    def heard() -> bool:
        text = client.diagnostics().get("joints", "")
        told.update(each for each in wanted if each in text)
        return len(told) == len(wanted)

    client.wait(heard)
    assert told == set(wanted)


def test_a_foreign_client_moves_the_arm(client: Any, launch: Callable, interfaces: Callable, held_block: Path) -> None:
    """Goals as for joint_trajectory_controller are tracked within tolerance, preempted, cancelled and refused."""
    interfaces("control_msgs")
    launch(scene=str(held_block), clock="fast", heartbeat=0.0, dt=0.01)
    states: list[JointState] = []
    client.node.create_subscription(JointState, "/gdfe_sim/joint_states", states.append, 100)
    follower = Follower(client)

    def send(lift: float, bend: float, seconds: float, tolerance: float = 1e-6) -> Any:
        near = {"path_tolerance": tolerance, "goal_tolerance": tolerance}
        return follower.send((lift, bend), names="lift bend", seconds=seconds, velocities=0.0, **near)

    def result(goal: Any) -> tuple[int, int]:
        return follower.result(goal)[:2]

    # Tracked: a cubic within the limits is followed to a microradian.
    assert result(send(1.2, 0.4, 1.0)) == (GoalStatus.STATUS_SUCCEEDED, 0)
    assert max(abs(each.error.positions[0]) for each in follower.told) < 1e-6
    client.wait(lambda: states and states[-1].position[0] == pytest.approx(1.2, abs=1e-9))
    # Preempted: the first goal is aborted, the second one succeeds from where the arm is.
    first = send(-1.0, 0.0, 1000.0)
    client.wait(lambda: follower.told)
    second = send(1.0, 0.0, 2.0)
    assert result(first) == (GoalStatus.STATUS_ABORTED, -1)
    assert result(second) == (GoalStatus.STATUS_SUCCEEDED, 0)
    # Cancelled: the arm stays where it is.
    third = send(-1.5, 0.0, 1000.0)
    client.wait(lambda: follower.told)
    client.wait(third.cancel_goal_async().done)
    assert result(third)[0] == GoalStatus.STATUS_CANCELED
    client.wait(lambda: states[-1].velocity[0] == 0.0)
    assert states[-1].position[0] > 0.9
    # Too fast: the limit of 1.5 rad/s holds it back, and the path's tolerance tells.
    assert result(send(-1.5, 0.0, 0.5, tolerance=0.05)) == (GoalStatus.STATUS_ABORTED, -4)
    # Beyond the limits, and a name that is not there: refused with the code.
    assert result(send(2.5, 0.0, 1.0)) == (GoalStatus.STATUS_ABORTED, -1)
    np.testing.assert_array_less(np.abs([state.velocity[0] for state in states]), 1.5 + 1e-9)


def test_the_hardware_moves_joints_and_tendons(client: Any, start: Callable) -> None:
    """A message of JointStateTopicSystem moves all joints and tendons, with NaN for interfaces without a command."""
    start(scene="arm_grasp", clock="fast", heartbeat=0.0, dt=0.01)
    heard: list[JointState] = []
    client.node.create_subscription(JointState, "/gdfe_sim/joint_states", heard.append, 100)
    client.wait(lambda: heard)
    names = [*list(heard[-1].name)[2:], "left", "right"]
    rest = dict(zip(heard[-1].name, heard[-1].position, strict=True))
    wanted = [rest[name] for name in names[:-2]]
    wanted[0] += 0.02
    none = math.nan
    client.publish(
        "joint_command",
        JointState(name=names, position=[*wanted, none, none], effort=[none] * len(wanted) + [0.5, 0.5]),
    )
    client.wait(lambda: heard[-1].position[2] == pytest.approx(0.02, abs=1e-9) and heard[-1].effort[0] == 0.5)
    assert heard[-1].position[2] == pytest.approx(0.02, abs=1e-9)
    assert heard[-1].effort[0] == 0.5
