# SPDX-License-Identifier: Apache-2.0
"""Actuators over topics: commands by name, by order and over time; states, probes and the Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from gdfe_ros.node.messages import stamp
from gdfe_ros.simulation import Command
from gdfe_ros.testing import Simulator

FINGER = {"scene": "tendon_finger", "clock": "lockstep", "dt": 0.1}


def test_tendons_bend_the_finger_under_commands_in_order() -> None:
    """Pull the flexor: the tip goes down and back, the state shows the tension, the strain rises."""
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


def test_actuators_are_commanded_by_name_and_over_time(
    client: Any, start: Callable, records_of: Callable, tmp_path: Path
) -> None:
    """Command by JointState, then by a trajectory as fast as possible; bad ones are refused and counted."""
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
    tensions = [record.actuators["flexor"] for record in records_of(tmp_path / "bag") if "flexor" in record.actuators]
    np.testing.assert_allclose(tensions, 2.0 - np.abs(2.0 - 0.2 * np.arange(1, 21)), atol=1e-6)


def test_the_jacobian_predicts_the_motion_of_the_tip(client: Any, start: Callable) -> None:
    """Ask for d tip / d tension: a small change of tension moves the tip by as much; labels name both."""
    tips: list[PoseStamped] = []
    jacobians: list[Float64MultiArray] = []
    start(**FINGER, scene_overrides=["solver.tolerance=1e-6"])
    client.node.create_subscription(PoseStamped, client.full("probe/tip"), tips.append, 10)
    client.node.create_subscription(Float64MultiArray, client.full("jacobian"), jacobians.append, 10)
    client.publish("commands", Float64MultiArray(data=[1.0, 0.0]))
    client.wait(lambda: client.records() and client.records()[-1].actuators.get("flexor") == 1.0)
    response = client.call(Trigger, "compute_jacobian", Trigger.Request())
    assert response.success, response.message
    client.wait(lambda: jacobians)
    assert [dimension.label for dimension in jacobians[0].layout.dim] == ["tip", "x,y,z", "flexor,extensor"]
    jacobian = np.array(jacobians[0].data).reshape(1, 3, 2)
    before, after = (_tip_at(client, tips, tension) for tension in (1.0, 1.02))
    assert (after - before) / 0.02 == pytest.approx(jacobian[0, [0, 2], 0], rel=0.03)


def _tip_at(client: Any, tips: list[PoseStamped], tension: float) -> np.ndarray:
    """Pull the flexor, and wait for the step and the place of the tip [m] in it."""
    count = len(client.records())
    client.publish("commands", Float64MultiArray(data=[tension, 0.0]))
    client.wait(lambda: len(client.records()) > count)
    assert client.records()[-1].actuators["flexor"] == tension
    moment = stamp(client.records()[-1].time)
    tip = client.wait(lambda: [tip.pose.position for tip in tips if tip.header.stamp == moment])[0]
    return np.array([tip.x, tip.z])
