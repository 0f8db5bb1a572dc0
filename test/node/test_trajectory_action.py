# SPDX-License-Identifier: Apache-2.0
"""FollowJointTrajectory: goals, feedback, tolerances, ends; its messages are built where they are not installed."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from sensor_msgs.msg import JointState

from test.node.conftest import Follower

FINGER = {"scene": "tendon_finger", "clock": "fast", "heartbeat": 0.0, "dt": 0.1}


@pytest.fixture
def follower(client: Any, launch: Callable, interfaces: Callable) -> Follower:
    """Give a client of the action of a running tendon finger."""
    interfaces("control_msgs")
    launch(**FINGER)
    return Follower(client)


def test_a_trajectory_is_followed_with_feedback(client: Any, follower: Follower) -> None:
    """A goal of two points succeeds at its end, with feedback of desired and actual values."""
    status, code, reason = follower.result(follower.send(1.0, 0.5, goal_tolerance=1e-9))
    assert (status, code, reason) == (GoalStatus.STATUS_SUCCEEDED, 0, "")
    client.wait(lambda: sum(bool(record.actuators) for record in client.records()) >= 20)
    pulled = [record.actuators["flexor"] for record in client.records() if record.actuators]
    np.testing.assert_allclose(pulled, [*np.arange(0.1, 1.05, 0.1), *np.arange(0.95, 0.45, -0.05)], atol=1e-9)
    assert follower.told
    for feedback in follower.told:
        assert feedback.joint_names == ["flexor"]
        assert feedback.desired.positions[0] == pytest.approx(feedback.actual.positions[0])


def test_a_bad_goal_ends_with_its_code(client: Any, follower: Follower) -> None:
    """An unknown joint, a value out of range, or no point aborts the goal with an error code and allowed values."""
    status, code, reason = follower.result(follower.send(1.0, names="biceps"))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -2)
    assert "no actuator biceps; actuators: flexor, extensor" in reason
    status, code, reason = follower.result(follower.send(1e3))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -1)
    assert "allowed: 0 to" in reason
    assert follower.result(follower.send())[1] == -1
    # Between the points, or before the first one, which the first step of the trajectory finds.
    for values in ((0.0, 0.0), (0.0,)):
        status, code, reason = follower.result(follower.send(*values, velocities=9.0))
        assert (status, code) == (GoalStatus.STATUS_ABORTED, -1)
        assert re.match(r"\S+ s after its start, .* takes 'flexor' to \S+; allowed: 0 to \S+; remedy: smaller", reason)
    assert client.diagnostics()["commands refused"] == "5"
    assert not any(record.actuators for record in client.records())


def test_a_goal_ends_by_what_others_do(client: Any, follower: Follower) -> None:
    """A cancellation, a command of the actuator, and a reset end a goal; the tension stays or is reset."""
    goal = follower.send(2.0, seconds=1000)
    client.wait(lambda: follower.told)
    client.wait(goal.cancel_goal_async().done)
    assert follower.result(goal)[0] == GoalStatus.STATUS_CANCELED
    steps = client.status()["steps"]
    assert client.status()["steps"] == steps
    goal = follower.send(2.0, seconds=1000)
    client.publish("actuation", JointState(name=["extensor"], effort=[0.1]))
    client.wait(lambda: follower.told)
    client.publish("actuation", JointState(name=["flexor"], effort=[0.1]))
    status, code, reason = follower.result(goal)
    assert (status, code, reason) == (GoalStatus.STATUS_ABORTED, -1, "a later command of flexor took its place")
    goal = follower.send(2.0, seconds=1000)
    client.trigger("reset")
    assert follower.result(goal)[2] == "the simulation was reset"


def test_tolerances_hold_what_a_rate_limit_holds_back(client: Any, launch: Callable, interfaces: Callable) -> None:
    """A rate of 0.5 N/s violates the path tolerance, or the goal tolerance, of a goal of 1 N in a second."""
    interfaces("control_msgs")
    launch(**FINGER, scene_overrides=["actuators.flexor.cable.rate=0.5"])
    follower = Follower(client)
    status, code, reason = follower.result(follower.send(1.0, path_tolerance=0.2))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -4)
    assert "allowed: 0.2 off" in reason
    client.trigger("reset")
    status, code, reason = follower.result(follower.send(1.0, goal_tolerance=0.2))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -5)
    assert "flexor is at 0.5 instead of 1" in reason


def test_a_goal_that_is_too_large_is_rejected(follower: Follower) -> None:
    """A goal of 100000 points is rejected unread, and the next one succeeds.

    Before, rclpy read it for seconds, in which the node answered nothing.
    """
    assert not follower.send(*[1.0] * 100_000).accepted
    assert follower.result(follower.send(1.0))[0] == GoalStatus.STATUS_SUCCEEDED
