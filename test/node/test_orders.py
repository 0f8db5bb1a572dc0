# SPDX-License-Identifier: Apache-2.0
"""Conversion of messages to orders: accepted messages, and refused ones with their reasons."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import PoseStamped, TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.node.command_messages import ActuatorOrders, pose_order, twist_order
from gdfe_ros.node.driving.orders import TwistOrder
from gdfe_ros.node.frames import Frames
from gdfe_ros.node.refusals import Freshness, Reason, Refusal
from test.written import scene_of

TIP = Handle("tip", np.arange(4, dtype=np.int32))
FRAMES = Frames("base_link")
BASE = Handle("base", np.arange(4, dtype=np.int32), fixed=True)
CABLES = """
mesh: {bar: {size: [0.1, 0.01, 0.01], cells: [4, 1, 1]}}
materials: {body: {law: linear, young: 1.0e5, poisson: 0.3}}
handles: {base: {where: {face: x-}, fixed: true}}
actuators:
  left: {cable: {points: [[0, 0, 0], [0.1, 0, 0]], command: tension, range: [0.0, 10.0]}}
  right: {cable: {points: [[0, 0, 0], [0.1, 0, 0]], command: length, range: [0.05, 0.2]}}
"""
ORDERS = ActuatorOrders(scene_of(CABLES))


def _pose(**changes: float) -> PoseStamped:
    message = PoseStamped()
    for name, value in changes.items():
        setattr(message.pose.position if name in "xyz" else message.pose.orientation, name[-1], value)
    return message


def _twist(**changes: float) -> TwistStamped:
    message = TwistStamped()
    for name, value in changes.items():
        setattr(message.twist.linear if name in "xyz" else message.twist.angular, name[-1], value)
    return message


def _refused(make: Callable[[], Any]) -> Reason:
    with pytest.raises(Refusal) as refusal:
        make()
    return refusal.value.reason


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"x": math.nan}, Reason.NOT_FINITE),
        ({"z": -math.inf}, Reason.NOT_FINITE),
        ({"qx": math.nan}, Reason.NOT_FINITE),
        ({"qw": 0.0}, Reason.NOT_UNIT),
        ({"qw": 1.01}, Reason.NOT_UNIT),
        ({"y": 1e300}, Reason.TOO_FAR),
        ({"y": 5.01}, Reason.TOO_FAR),
    ],
)
def test_bad_poses_are_refused(changes: dict, reason: Reason) -> None:
    """Poses that are not finite, with a quaternion that is not of unit length, or too far away, are refused."""
    assert _refused(lambda: pose_order(_pose(**changes), TIP, size=0.5, frames=FRAMES)) is reason


def test_a_fixed_handle_takes_no_commands() -> None:
    """A command for a fixed handle is refused as fixed, before other defects are checked."""
    assert _refused(lambda: pose_order(_pose(x=math.nan), BASE, size=0.5, frames=FRAMES)) is Reason.FIXED
    assert _refused(lambda: twist_order(_twist(), BASE, size=0.5, frames=FRAMES)) is Reason.FIXED


@pytest.mark.parametrize(
    ("changes", "reason"),
    [({"x": math.inf}, Reason.NOT_FINITE), ({"x": 1e9}, Reason.TOO_FAST), ({"az": 1e4}, Reason.TOO_FAST)],
)
def test_bad_velocities_are_refused(changes: dict, reason: Reason) -> None:
    """Velocities that are not finite or far too large are refused."""
    assert _refused(lambda: twist_order(_twist(**changes), TIP, size=0.5, frames=FRAMES)) is reason


def test_velocities_turn_a_handle_on_and_on() -> None:
    """At 40 rad/s, each step of 0.1 s adds 4 rad to the rotation, beyond full turns, and the translation is exact."""
    pose = Pose()
    for step in range(1, 9):
        pose = TwistOrder("tip", (0.1, 0.0, 0.0), (0.0, 0.0, 40.0)).after(pose, 0.1)
        assert pose.rotation == pytest.approx((0.0, 0.0, 4.0 * step))
    assert pose.translation == pytest.approx((0.08, 0.0, 0.0))


def test_joint_states_command_by_name_and_mode() -> None:
    """A JointState gives effort for a tension and position for a length, in any order and for any subset."""
    message = JointState(name=["right", "left"], position=[0.1, math.nan], effort=[math.nan, 3.0])
    assert ORDERS.from_joint_state(message).values == {"right": 0.1, "left": 3.0}
    assert ORDERS.from_joint_state(JointState(name=["left"], effort=[2.0])).values == {"left": 2.0}
    message = JointState(name=["right", "left"], position=[math.nan] * 2, effort=[math.nan, 3.0])
    assert ORDERS.from_joint_state(message).values == {"left": 3.0}
    assert ORDERS.from_joint_state(JointState(name=["left"], effort=[math.nan])).values == {}


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (JointState(), Reason.UNKNOWN),
        (JointState(name=["middle"], effort=[1.0]), Reason.UNKNOWN),
        (JointState(name=["left", "left"], effort=[1.0, 1.0]), Reason.MALFORMED),
        (JointState(name=["left"], position=[1.0]), Reason.WRONG_SIZE),
        (JointState(name=["left"], effort=[1.0, 2.0]), Reason.WRONG_SIZE),
        (JointState(name=["left"], effort=[math.inf]), Reason.NOT_FINITE),
        (JointState(name=["left"], effort=[-1.0]), Reason.OUT_OF_RANGE),
    ],
)
def test_bad_joint_states_are_refused(message: JointState, reason: Reason) -> None:
    """Unknown and repeated names, wrong sizes, and values not finite or out of range are refused."""
    assert _refused(lambda: ORDERS.from_joint_state(message)) is reason


def test_arrays_command_all_actuators() -> None:
    """An array needs one value per actuator in the scene's order; another length is refused."""
    assert ORDERS.from_array(Float64MultiArray(data=[1.0, 0.1])).values == {"left": 1.0, "right": 0.1}
    assert _refused(lambda: ORDERS.from_array(Float64MultiArray(data=[1.0]))) is Reason.WRONG_SIZE
    assert _refused(lambda: ORDERS.from_array(Float64MultiArray(data=[1.0, 9.0]))) is Reason.OUT_OF_RANGE


def _trajectory(
    *points: tuple[float, list[float]],
    start: int = 0,
    name: str = "left",
    slopes: Sequence[float] = (),
    bends: Sequence[float] = (),
) -> JointTrajectory:
    message = JointTrajectory(joint_names=[name])
    message.header.stamp.sec = start
    for moment, positions in points:
        nanoseconds = round(moment * 1e9)
        time = Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        message.points.append(JointTrajectoryPoint(positions=positions, time_from_start=time, accelerations=bends))
    for point, slope in zip(message.points, slopes, strict=False):
        point.velocities = [slope]
    return message


def test_trajectories_are_taken_point_by_point() -> None:
    """A trajectory's times and values are read, and its stamp is converted to simulation time."""
    order = ORDERS.from_trajectory(_trajectory((0.5, [1.0]), (1.5, [3.0]), start=2), now=1.0, convert=_later)
    assert (order.names, order.start) == (("left",), 2.5)
    assert order.times.tolist() == [0.5, 1.5]
    assert order.values.tolist() == [[1.0], [3.0]]


@pytest.mark.parametrize("bends", [[], [0.0]], ids=["cubic", "quintic"])
def test_trajectories_out_of_range_between_points_are_refused(bends: list[float]) -> None:
    """Between equal positions, T apart, with velocities v and -v, a cubic rises by T v / 4, a quintic by 5 T v / 16."""
    peak = "15.25" if bends else "14"
    wide = _trajectory((1.0, [9.0]), (2.0, [9.0]), slopes=[20.0, -20.0], bends=bends)
    with pytest.raises(Refusal, match=rf"1\.5 s after its start.*'left' to {peak}; allowed: 0 to 10; remedy") as found:
        ORDERS.from_trajectory(wide, now=0.0, convert=_later)
    assert found.value.reason is Reason.OUT_OF_RANGE
    close = _trajectory((1.0, [9.0]), (2.0, [9.0]), slopes=[3.0, -3.0], bends=bends)
    order = ORDERS.from_trajectory(close, now=0.0, convert=_later)
    # The motion to the first point depends on the command at the start.
    order.require_limits(np.array([8.0]))
    with pytest.raises(Refusal, match="allowed: 0 to 10"):
        order.require_limits(np.array([8.0]), np.array([30.0]))


def test_rounding_leaves_no_range() -> None:
    """From limit to limit with noise of 1e-6 in the velocities, all commands are within the limits."""
    falling = _trajectory((0.0, [10.0]), (0.7, [0.0]), slopes=[1e-6, 1e-6])
    order = ORDERS.from_trajectory(falling, now=0.0, convert=_later)
    values = [order.at(elapsed, np.array([0.0]))[0] for elapsed in 0.7 - np.linspace(0.0, 2e-8, 100)]
    assert min(values) == 0.0
    assert min(replace(order, limits=None).at(0.7 - 8e-9, np.array([0.0]))) < 0.0


def _later(stamp: int) -> float:
    """Convert a stamp [ns] to simulation time [s], which is half a second ahead in this test."""
    return 1e-9 * stamp + 0.5


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (_trajectory(name="middle"), Reason.UNKNOWN),
        (_trajectory((1.0, [])), Reason.WRONG_SIZE),
        (_trajectory((1.0, [1.0]), (1.0, [2.0])), Reason.OUT_OF_ORDER),
        (_trajectory((1.0, [99.0])), Reason.OUT_OF_RANGE),
        (_trajectory((1.0, [1.0]), start=5), Reason.STALE),
        (_trajectory((1.0, [1.0]), start=71), Reason.AHEAD),
    ],
)
def test_bad_trajectories_are_refused(message: JointTrajectory, reason: Reason) -> None:
    """Unknown names, wrong sizes, times not ascending or past, and values out of range are refused."""
    assert _refused(lambda: ORDERS.from_trajectory(message, now=10.0, convert=_later)) is reason


def test_stamps_must_not_be_old_or_ahead_or_go_back() -> None:
    """Rising and zero stamps are accepted; falling, old and future ones are refused; a reset forgets the last stamp."""
    freshness = Freshness()

    def check(seconds: int, max_age: float = 0.0, source: str = "in", now: int = 100) -> None:
        freshness.check([source], Time(sec=seconds), now=now * 10**9, max_age=max_age, max_lead=0.5)

    for seconds in (50, 50, 0, 60):
        check(seconds)
    assert _refused(lambda: check(59)) is Reason.OUT_OF_ORDER
    check(59, source="other")
    assert _refused(lambda: check(70, max_age=20.0)) is Reason.STALE
    assert _refused(lambda: check(101)) is Reason.AHEAD
    check(90, max_age=20.0)
    check(30, now=40)
    assert _refused(lambda: check(29, now=41)) is Reason.OUT_OF_ORDER
    freshness.reset()
    check(1, now=41)


@pytest.mark.parametrize("frame", ["odom", "/base_link", "tip"])
def test_commands_in_other_frames_are_refused_by_name(frame: str) -> None:
    """A target or velocity in an unknown frame is refused; an empty frame, the node's and the handle's are accepted."""
    for message, order in ((_pose(), pose_order), (_twist(), twist_order)):
        for allowed in ("", "base_link", "tip_rest"):
            message.header.frame_id = allowed
            order(message, TIP, size=0.5, frames=FRAMES)
        message.header.frame_id = frame
        with pytest.raises(Refusal, match=f"frame_id is '{frame}'; allowed: empty, 'base_link' or 'tip_rest'"):
            order(message, TIP, size=0.5, frames=FRAMES)
