# SPDX-License-Identifier: Apache-2.0
"""Actuators over topics: commands by name, by order and over time; states, probes and the Jacobian."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.node.messages import to_time
from gdfe_ros.recording.step import Begin
from gdfe_ros.simulation import Command
from gdfe_ros.testing import Simulator

FINGER = {"scene": "tendon_finger", "clock": "lockstep", "dt": 0.1}


def test_tendons_bend_the_finger_under_commands_in_order() -> None:
    """As the flexor is pulled, the tip moves down and the strain rises; states and records have the tension."""
    with Simulator("tendon_finger") as simulator:
        rest = simulator.state
        bent = [simulator.step(Command(actuators={"flexor": tension})) for tension in (1.0, 2.0)]
        again = simulator.step()
    heights = [state.probes["tip"].translation[2] for state in (rest, *bent)]
    assert heights[0] > heights[1] > heights[2]
    assert bent[1].joints["flexor"][2] == 2.0
    assert bent[1].joints["flexor"][0] < bent[0].joints["flexor"][0] < rest.joints["flexor"][0]
    assert bent[1].joints["flexor"][1] == pytest.approx(
        (bent[1].joints["flexor"][0] - bent[0].joints["flexor"][0]) / 0.01
    )
    assert bent[1].probes["tip"].rotation[1] > 0.1
    assert bent[1].record.actuators == {"flexor": 2.0, "extensor": 0.0}
    assert again.record.skipped["solve"] == 1
    assert np.array_equal(again.positions, bent[1].positions)


def test_actuators_are_commanded_by_name_and_over_time(client: Any, start: Callable, tmp_path: Path) -> None:
    """Actuators follow a JointState, and a trajectory with the fast clock; invalid commands are refused and counted."""
    process = start(**{**FINGER, "clock": "fast", "heartbeat": 0.0}, record=True, bag_path=str(tmp_path / "bag"))
    client.publish("actuation", JointState(name=["extensor"], effort=[1.0]))
    client.wait(lambda: any(record.actuators == {"extensor": 1.0} for record in client.records()))
    client.publish("actuation", JointState(name=["extensor"], effort=[41.0]))
    client.publish("commands", Float64MultiArray(data=[1.0]))
    points = [
        JointTrajectoryPoint(positions=[value], time_from_start=Duration(sec=seconds))
        for seconds, value in ((1, 2.0), (2, 0.0))
    ]
    client.publish("trajectory", JointTrajectory(joint_names=["flexor"], points=points))
    client.wait(lambda: int(client.diagnostics()["steps"]) >= 22)
    client.wait(lambda: int(client.diagnostics()["commands refused"]) >= 2)
    values = client.diagnostics()
    assert (values["refused: out of range"], values["refused: wrong size"]) == ("1", "1")
    process.stop()
    tensions = [
        record.actuators["flexor"] for record in BagRun(tmp_path / "bag").records if "flexor" in record.actuators
    ]
    np.testing.assert_allclose(tensions, 2.0 - np.abs(2.0 - 0.2 * np.arange(1, 21)), atol=1e-6)


def test_two_publishers_of_one_topic_lose_no_command(client: Any, launch: Callable) -> None:
    """Commands of two tendons by two publishers of ~/actuation before one step are both consumed by that step."""
    launch(**{**FINGER, "clock": "wall", "heartbeat": 0.0})
    publishers = [client.node.create_publisher(JointState, client.full("actuation"), 100) for _ in range(2)]
    client.wait(lambda: all(publisher.get_subscription_count() for publisher in publishers))
    client.switch("pause", True)
    for count in range(1, 4):
        for _ in range(5):
            for publisher, name in zip(publishers, ("flexor", "extensor"), strict=True):
                message = JointState(name=["flexor", "extensor"], effort=[math.nan] * 2)
                message.effort[message.name.index(name)] = float(count)
                publisher.publish(message if count == 2 else JointState(name=[name], effort=[float(count)]))
        client.wait_taken(10 * count)
        client.advance()
        client.wait(lambda count=count: client.record().actuators == {"flexor": count, "extensor": count})
    assert client.diagnostics()["commands refused"] == "0"


def test_a_command_of_one_tendon_leaves_the_course_of_another(client: Any, start: Callable) -> None:
    """While the extensor is commanded in nine steps, the flexor's trajectory of ten steps continues to its end."""
    start(**FINGER)
    points = [JointTrajectoryPoint(positions=[2.0], time_from_start=Duration(sec=1))]
    client.publish("trajectory", JointTrajectory(joint_names=["flexor"], points=points))
    for count in range(1, 10):
        client.wait_steps(count + 1)
        client.publish("actuation", JointState(name=["extensor"], effort=[0.1 * count]))
    client.wait_steps(11)
    records = client.records()[1:]
    np.testing.assert_allclose([record.actuators["flexor"] for record in records], 0.2 * np.arange(1, 11))
    np.testing.assert_allclose([record.actuators["extensor"] for record in records[1:]], 0.1 * np.arange(1, 10))


def test_an_empty_trajectory_ends_the_running_one(client: Any, start: Callable) -> None:
    """A trajectory without points ends a running one, and the tension stays."""
    start(**{**FINGER, "clock": "fast", "heartbeat": 0.0, "dt": 0.01})
    points = [JointTrajectoryPoint(positions=[2.0], time_from_start=Duration(sec=1000))]
    client.publish("trajectory", JointTrajectory(joint_names=["flexor"], points=points))
    client.wait(lambda: any(record.actuators for record in client.records()))
    client.publish("trajectory", JointTrajectory())
    client.wait_taken(2)
    client.status()
    steps = client.status()["steps"]
    assert client.status()["steps"] == steps
    pulled = [record.actuators["flexor"] for record in client.records() if record.actuators]
    assert 0.0 < pulled[-1] < 1.9
    assert client.diagnostics()["commands refused"] == "0"


def test_the_jacobian_predicts_the_motion_of_the_tip(client: Any, start: Callable) -> None:
    """The Jacobian d tip / d tension predicts the tip's motion for a small change, and its labels name both."""
    tips: list[PoseStamped] = []
    jacobians: list[Float64MultiArray] = []
    start(**FINGER, scene_overrides=["solver.tolerance=1e-6"])
    client.node.create_subscription(PoseStamped, client.full("probe/tip"), tips.append, 10)
    client.node.create_subscription(Float64MultiArray, client.full("jacobian"), jacobians.append, 10)
    client.publish("commands", Float64MultiArray(data=[1.0, 0.0]))
    client.wait(lambda: client.record().actuators.get("flexor") == 1.0)
    client.trigger("compute_jacobian")
    client.wait(lambda: jacobians)
    assert [dimension.label for dimension in jacobians[0].layout.dim] == ["tip", "x,y,z", "flexor,extensor"]
    jacobian = np.array(jacobians[0].data).reshape(1, 3, 2)
    before, after = (_tip_at(client, tips, tension) for tension in (1.0, 1.02))
    assert (after - before) / 0.02 == pytest.approx(jacobian[0, [0, 2], 0], rel=0.03)


def _tip_at(client: Any, tips: list[PoseStamped], tension: float) -> np.ndarray:
    """Pull the flexor; return the step and the tip's position [m] in it."""
    count = len(client.records())
    client.publish("commands", Float64MultiArray(data=[tension, 0.0]))
    client.wait(lambda: len(client.records()) > count)
    assert client.record().actuators["flexor"] == tension
    moment = to_time(client.record().stamp)
    tip = client.wait(lambda: [tip.pose.position for tip in tips if tip.header.stamp == moment])[0]
    return np.array([tip.x, tip.z])


def test_a_bag_begun_under_load_replays(client: Any, launch: Callable, replays: Callable, tmp_path: Path) -> None:
    """A bag started by the service under load, without a subscriber of joint states, replays bit for bit."""
    launch(scene="tendon_finger", scene_overrides=["solver.tolerance=1e-3"], bag_path=str(tmp_path / "bag"))
    client.publish("actuation", JointState(name=["flexor"], effort=[1.0]))
    client.wait(lambda: any(record.actuators.get("flexor") == 1.0 for record in client.records()))
    client.switch("record", True)
    client.publish("actuation", JointState(name=["flexor"], effort=[1.5]))
    client.wait(lambda: any(record.actuators.get("flexor") == 1.5 for record in client.records()))
    client.switch("record", False)
    assert ("joint_states", "velocity") in replays(tmp_path / "bag")


@pytest.mark.parametrize("clock", ["lockstep", "wall"])
def test_a_bag_begun_before_any_command_begins_at_rest(
    client: Any, launch: Callable, replays: Callable, tmp_path: Path, clock: str
) -> None:
    """A bag begun by the service after the activation or a reset replays bit for bit, also with other materials."""
    launch(scene="tendon_finger", clock=clock, heartbeat=0.0)
    for bag in (tmp_path / "activated", tmp_path / "reset"):
        client.set(bag_path=str(bag))
        client.switch("record", True)
        count = len(client.records())
        client.publish("actuation", JointState(name=["flexor"], effort=[1.0]))
        client.wait(lambda count=count: any(each.actuators.get("flexor") == 1.0 for each in client.records()[count:]))
        client.switch("record", False)
        replays(bag, node=True)
        assert BagRun(bag).records[0].begin is Begin.REST
        assert Replay(BagRun(bag), overrides={"materials.web.young": 13e6}).run().differences.steps > 1
        client.trigger("reset")
