# SPDX-License-Identifier: Apache-2.0
"""FollowJointTrajectory: goals, feedback, tolerances, ends; its messages are built where they are not installed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

FINGER = {"scene": "tendon_finger", "clock": "fast", "heartbeat": 0.0, "dt": 0.1}


class _Follower:
    """A client of the action."""

    def __init__(self, client: Any) -> None:
        from control_msgs.action import FollowJointTrajectory
        from control_msgs.msg import JointTolerance

        self._client, self._kind, self._tolerance = client, FollowJointTrajectory, JointTolerance
        self.told: list[Any] = []
        self._action = client.action(FollowJointTrajectory, "follow_joint_trajectory")

    def send(self, values: list[float], *, name: str = "flexor", seconds: int = 1, **more: Any) -> Any:
        """Send a goal with a point every ``seconds``; return its handle. Keywords set tolerances."""
        self.told.clear()
        points = [
            JointTrajectoryPoint(positions=[value], time_from_start=Duration(sec=seconds * place))
            for place, value in enumerate(values, start=1)
        ]
        tolerances = {key: [self._tolerance(name=name, position=value)] for key, value in more.items()}
        goal = self._kind.Goal(trajectory=JointTrajectory(joint_names=[name], points=points), **tolerances)
        sent = self._action.send_goal_async(goal, feedback_callback=lambda message: self.told.append(message.feedback))
        self._client.wait(sent.done)
        return sent.result()

    def result(self, goal: Any) -> tuple[int, int, str]:
        """Wait for the end of a goal; return status, error code and reason."""
        future = goal.get_result_async()
        self._client.wait(future.done)
        result = future.result().result
        return future.result().status, result.error_code, result.error_string


@pytest.fixture
def follower(client: Any, launch: Callable, interfaces: Callable) -> _Follower:
    """Give a client of the action of a running tendon finger."""
    interfaces("control_msgs")
    launch(**FINGER)
    return _Follower(client)


def test_a_trajectory_is_followed_with_feedback(client: Any, follower: _Follower) -> None:
    """A goal of two points succeeds at its end, with feedback of desired and actual values."""
    status, code, reason = follower.result(follower.send([1.0, 0.5], goal_tolerance=1e-9))
    assert (status, code, reason) == (GoalStatus.STATUS_SUCCEEDED, 0, "")
    client.wait(lambda: sum(bool(record.actuators) for record in client.records()) >= 20)
    pulled = [record.actuators["flexor"] for record in client.records() if record.actuators]
    np.testing.assert_allclose(pulled, [*np.arange(0.1, 1.05, 0.1), *np.arange(0.95, 0.45, -0.05)], atol=1e-9)
    assert follower.told
    for feedback in follower.told:
        assert feedback.joint_names == ["flexor"]
        assert feedback.desired.positions[0] == pytest.approx(feedback.actual.positions[0])


def test_a_bad_goal_ends_with_its_code(client: Any, follower: _Follower) -> None:
    """An unknown joint, a value out of range, or no point aborts the goal with an error code and allowed values."""
    status, code, reason = follower.result(follower.send([1.0], name="biceps"))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -2)
    assert "no actuator biceps; actuators: flexor, extensor" in reason
    status, code, reason = follower.result(follower.send([1e3]))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -1)
    assert "allowed: 0 to" in reason
    assert follower.result(follower.send([]))[1] == -1
    assert client.diagnostics()["commands refused"] == "3"


def test_a_goal_ends_by_what_others_do(client: Any, follower: _Follower) -> None:
    """A cancellation, a command of the actuator, and a reset end a goal; the tension stays or is reset."""
    goal = follower.send([2.0], seconds=1000)
    client.wait(lambda: follower.told)
    client.wait(goal.cancel_goal_async().done)
    assert follower.result(goal)[0] == GoalStatus.STATUS_CANCELED
    steps = client.status()["steps"]
    assert client.status()["steps"] == steps
    goal = follower.send([2.0], seconds=1000)
    client.publish("actuation", JointState(name=["extensor"], effort=[0.1]))
    client.wait(lambda: follower.told)
    client.publish("actuation", JointState(name=["flexor"], effort=[0.1]))
    status, code, reason = follower.result(goal)
    assert (status, code, reason) == (GoalStatus.STATUS_ABORTED, -1, "a later command of flexor took its place")
    goal = follower.send([2.0], seconds=1000)
    client.trigger("reset")
    assert follower.result(goal)[2] == "the simulation was reset"


def test_tolerances_hold_what_a_rate_limit_holds_back(client: Any, launch: Callable, interfaces: Callable) -> None:
    """A rate of 0.5 N/s violates the path tolerance, or the goal tolerance, of a goal of 1 N in a second."""
    interfaces("control_msgs")
    launch(**FINGER, scene_overrides=["actuators.flexor.cable.rate=0.5"])
    follower = _Follower(client)
    status, code, reason = follower.result(follower.send([1.0], path_tolerance=0.2))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -4)
    assert "allowed: 0.2 off" in reason
    client.trigger("reset")
    status, code, reason = follower.result(follower.send([1.0], goal_tolerance=0.2))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -5)
    assert "flexor is at 0.5 instead of 1" in reason


def test_a_goal_that_is_too_large_is_rejected(follower: _Follower) -> None:
    """A goal of 100000 points is rejected unread, and the next one succeeds.

    Before, rclpy read it for seconds, in which the node answered nothing.
    """
    assert not follower.send([1.0] * 100_000).accepted
    assert follower.result(follower.send([1.0]))[0] == GoalStatus.STATUS_SUCCEEDED
