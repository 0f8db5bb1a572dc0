# SPDX-License-Identifier: Apache-2.0
"""Conversion of command messages to orders; invalid messages are refused with a reason."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, TwistStamped
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory

from gdfe_ros.actuators import Mode
from gdfe_ros.command import Orders, require_movable
from gdfe_ros.constraints import Handle
from gdfe_ros.errors import CommandError, RangeError
from gdfe_ros.node.driving.orders import (
    LARGEST_TARGET,
    ActuatorOrder,
    PoseOrder,
    TeleportOrder,
    TrajectoryOrder,
    TwistOrder,
    require_near,
)
from gdfe_ros.node.frames import Frames, Placement
from gdfe_ros.node.refusals import Reason, Refusal, require_finite, require_place
from gdfe_ros.scene.scene import Scene

UNIT_SLACK = 1e-3
"""Largest allowed difference between a quaternion's length and 1."""
FASTEST_TURN = 1e3
"""Largest allowed angular velocity [rad/s]."""
Vector, Quaternion = tuple[float, float, float], tuple[float, float, float, float]


def pose_order(message: PoseStamped, handle: Handle, *, size: float, frames: Frames) -> PoseOrder:
    """Return the order of a message with a target pose.

    If the header's frame is empty, the node's frame or the handle's rest frame, the target is relative to the rest
    pose. With any other frame, the target is the pose of the handle's own frame in this frame.

    Args:
        message: target pose.
        handle: the commanded handle.
        size: size of the body [m].
        frames: frames of the body.

    Raises:
        Refusal: the handle is fixed, no transforms lead to the header's frame, a number is not finite, the quaternion
            is not of unit length, or the translation exceeds ten times the body's size.
    """
    _require_movable(handle)
    return PoseOrder(handle.name, *_read_place(message, handle, size, frames))


def put_order(message: PoseStamped, handle: Handle, *, size: float, frames: Frames) -> TeleportOrder:
    """Return the order to teleport a rigid body; arguments as for ``pose_order``.

    Raises:
        Refusal: as for ``pose_order``, except for fixed handles.
    """
    return TeleportOrder(handle.name, *_read_place(message, handle, size, frames))


def make_pose_order(handle: Handle, place: Placement, *, size: float, frames: Frames) -> PoseOrder:
    """Return the order that moves a handle's frame to ``place`` in the node's frame; ``size`` is the body's size [m].

    Raises:
        Refusal: the place is farther from the rest pose than ten times the body's size.
    """
    rest = frames.rests()[frames.rest(handle.name)]
    return PoseOrder(handle.name, *_unpack_near(rest.inverse() @ place, size))


def require_pose(pose: PoseMessage) -> Placement:
    """Check a pose message and return its placement.

    Raises:
        Refusal: a number is not finite, or the quaternion is not of unit length.
    """
    require_place(pose.position, pose.orientation, UNIT_SLACK)
    return Placement.of(pose.position, pose.orientation)


def twist_order(message: TwistStamped, handle: Handle, *, size: float, frames: Frames) -> TwistOrder:
    """Return the order of a velocity message. Its vectors are in the axes of the header's frame.

    Arguments are as for ``pose_order``.

    Raises:
        Refusal: the handle is fixed, no transforms lead to the header's frame, a number is not finite, the velocity
            exceeds ten body sizes a second, or the angular velocity exceeds `FASTEST_TURN`.
    """
    _require_movable(handle)
    place = frames.relative(message.header.frame_id, handle.name)
    linear = (message.twist.linear.x, message.twist.linear.y, message.twist.linear.z)
    angular = (message.twist.angular.x, message.twist.angular.y, message.twist.angular.z)
    require_finite(linear=linear, angular=angular)
    if math.hypot(*linear) > LARGEST_TARGET * size:
        most = f"{LARGEST_TARGET * size:.3g} m/s, {LARGEST_TARGET:g} body sizes a second"
        text = f"linear velocity {linear} m/s; allowed: {most}"
        raise Refusal(Reason.TOO_FAST, text)
    if math.hypot(*angular) > FASTEST_TURN:
        raise Refusal(Reason.TOO_FAST, f"angular velocity {angular} rad/s; allowed: {FASTEST_TURN:g} rad/s")
    if place is not None:
        linear, angular = (tuple(place.turn.apply(vector).tolist()) for vector in (linear, angular))
    return TwistOrder(handle.name, linear, angular)


def _read_place(message: PoseStamped, handle: Handle, size: float, frames: Frames) -> tuple[Vector, Quaternion]:
    """Return a message's translation from rest [m] and quaternion, bitwise as sent if no transform is needed."""
    place = frames.relative(message.header.frame_id, handle.name)
    if place is not None:
        return _unpack_near(place @ require_pose(message.pose), size)
    translation, quaternion = require_place(message.pose.position, message.pose.orientation, UNIT_SLACK)
    require_near(translation, size)
    return translation, quaternion


def _unpack_near(place: Placement, size: float) -> tuple[Vector, Quaternion]:
    """Return translation [m] and quaternion of a placement relative to rest; refuse it if it is too far from rest."""
    translation = tuple(place.origin.tolist())
    require_near(translation, size)
    return translation, tuple(place.turn.as_quat().tolist())


def _require_movable(handle: Handle) -> None:
    try:
        require_movable(handle)
    except CommandError as error:
        raise Refusal(Reason.FOLLOWS if handle.carrier else Reason.FIXED, str(error)) from error


LONGEST = 80
"""Largest number of characters of an unknown name in a refusal."""
LATEST_START = 60.0
"""Longest allowed time [s] until a trajectory starts. Meanwhile the node makes steps, even without other commands."""


class ActuatorOrders:
    """Converts command messages to orders, after a check against the actuators, loads and joints of a scene.

    Args:
        scene: the scene; its actuators are in the order of ``~/commands``.
    """

    def __init__(self, scene: Scene) -> None:
        self._orders = Orders(scene, scene.solver)
        self._actuators, self._loads, self._joints = self._orders.actuators, self._orders.loads, self._orders.joints

    def from_joint_state(self, message: JointState) -> ActuatorOrder:
        """Return the commands in a JointState: ``effort`` of actuators commanded by effort, ``position`` of all others.

        The ``position`` of a load is its factor [1], that of a joint is its position [rad] or [m]. A value of NaN
        commands nothing.

        Raises:
            Refusal: a name is unknown or repeated, an array has the wrong size, or a value is infinite or out of range.
        """
        self._require_known(message.name)
        values = {}
        for place, name in enumerate(message.name):
            forced = name in self._actuators and self._actuators[name].mode.by_effort
            field = "effort" if forced else "position"
            array = getattr(message, field)
            if len(array) != len(message.name):
                text = (
                    f"{field} has {len(array)} entries for {len(message.name)} names; {name!r} is commanded by {field}"
                )
                raise Refusal(Reason.WRONG_SIZE, text)
            if not math.isnan(array[place]):  # ros2_control's "no command"
                values[name] = self._check(name, array[place])
        return ActuatorOrder(values)

    def from_grip(self, message: String, *, holds: float, present: Callable[[], Mapping[str, float]]) -> ActuatorOrder:
        """Return the order by which the named grip takes hold (``holds`` 1) or lets go (0).

        Args:
            message: name of the grip.
            holds: the command.
            present: function that returns the commands of the last step.

        Raises:
            Refusal: there is no such grip, or it holds already, or it holds nothing.
        """
        grips = [name for name, actuator in self._actuators.items() if actuator.mode is Mode.GRIP]
        name = message.data
        if name not in grips:
            raise Refusal(Reason.UNKNOWN, f"no grip {name[:LONGEST]!r}; grips: {', '.join(grips)}")
        if present()[name] == holds:
            text = "is attached already; remedy: ~/release first" if holds else "is attached to nothing"
            raise Refusal(Reason.OUT_OF_ORDER, f"grip {name!r} {text}")
        return ActuatorOrder({name: holds})

    def from_array(self, message: Float64MultiArray) -> ActuatorOrder:
        """Return the commands of an array with one value for each actuator, in the scene's order and each mode's unit.

        Raises:
            Refusal: the array has the wrong size, or a value is not finite or out of range.
        """
        names = list(self._actuators)
        if len(message.data) != len(names):
            text = f"{len(message.data)} values for {len(names)} actuators; allowed: one for each of {', '.join(names)}"
            raise Refusal(Reason.WRONG_SIZE, text)
        pairs = zip(names, message.data, strict=True)
        return ActuatorOrder({name: self._check(name, value) for name, value in pairs})

    def from_trajectory(
        self, message: JointTrajectory, *, now: float, convert: Callable[[int], float]
    ) -> TrajectoryOrder:
        """Return the order of a trajectory; ``positions`` are in the unit of each mode, ``effort`` is ignored.

        A trajectory without points ends the running trajectories of the named actuators, loads and joints. If it has
        no names either, it ends all trajectories. The present commands stay in force, as in
        joint_trajectory_controller.

        Args:
            message: trajectory, which starts at its header's stamp; with stamp 0, it starts with the step that consumes
                it.
            now: present simulation time [s].
            convert: function that returns the simulation time [s] of a stamp [ns].

        Raises:
            Refusal: a name is unknown or repeated, a point has the wrong size, a time is negative, the times do not
                ascend, the end is in the past, the start is too far ahead, or a value is not finite or, at a point or
                between two points, out of range.
        """
        names = tuple(message.joint_names)
        if not message.points:
            names = names or (*self._actuators, *self._loads, *self._joints)
            self._require_known(names)
            return TrajectoryOrder(names, None, np.zeros(0), np.zeros((0, len(names))))
        self._require_known(names)
        times = np.array([_seconds(point.time_from_start) for point in message.points])
        if times[0] < 0.0 or (np.diff(times) <= 0.0).any():
            raise Refusal(Reason.OUT_OF_ORDER, f"time_from_start {times.tolist()} s must ascend from 0 on")
        points = [zip(names, row, strict=True) for row in _rows(message, "positions")]
        rows = [[self._check(name, value) for name, value in point] for point in points]
        stamp = message.header.stamp
        start = convert(stamp.sec * 10**9 + stamp.nanosec) if stamp.sec or stamp.nanosec else None
        _require_timely(start, times[-1], now)
        slopes = _table(message, "velocities")
        bends = _table(message, "accelerations") if slopes is not None else None
        limits = np.transpose([self._orders.limits(name) for name in names])
        order = TrajectoryOrder(names, start, times, np.array(rows), slopes, bends, limits)
        order.require_limits()
        return order

    def _require_known(self, names: Sequence[str]) -> None:
        unknown = sorted(set(names) - set(self._actuators) - set(self._loads) - set(self._joints))
        if unknown or not names:
            known = ", ".join(self._actuators) or "none"
            loads = f"; loads: {', '.join(self._loads)}" if self._loads else ""
            loads += f"; joints: {', '.join(self._joints)}" if self._joints else ""
            text = f"no actuator {', '.join(unknown) or 'is named'}; actuators: {known}{loads}"
            raise Refusal(Reason.UNKNOWN, text)
        if len(set(names)) != len(names):
            raise Refusal(Reason.MALFORMED, f"names {list(names)} contain a name twice")

    def _check(self, name: str, value: float) -> float:
        try:
            return self._orders.require(name, value)
        except CommandError as error:
            reason = Reason.OUT_OF_RANGE if isinstance(error, RangeError) else Reason.NOT_FINITE
            raise Refusal(reason, str(error)) from error


def _require_timely(start: float | None, duration: float, now: float) -> None:
    """Refuse a trajectory that starts too far ahead of the simulation time ``now`` [s], or has ended; None: at once."""
    if start is not None and start > now + LATEST_START:
        text = (
            f"the trajectory starts at {start:.9g} s, but the time is {now:.9g} s; allowed: {LATEST_START:g} s "
            "ahead, or stamp 0"
        )
        raise Refusal(Reason.AHEAD, text)
    if start is not None and start + duration < now:
        raise Refusal(Reason.STALE, f"the trajectory ended at {start + duration:.9g} s; the time is {now:.9g} s")


def _table(message: JointTrajectory, field: str) -> NDArray[np.float64] | None:
    """Return the velocities or accelerations (k, n) of all k points; None if a point has none.

    Raises:
        Refusal: a point has the wrong number of values, or a value is not finite.
    """
    if not all(len(getattr(point, field)) for point in message.points):
        return None
    rows = _rows(message, field)
    for place, row in enumerate(rows):
        if not all(map(math.isfinite, row)):
            raise Refusal(Reason.NOT_FINITE, f"point {place} has the {field} {row}; allowed: finite numbers")
    return np.array(rows)


def _rows(message: JointTrajectory, field: str) -> list[list[float]]:
    """Return the values of a field of all points, one for each name; refuse a point with another number of values."""
    rows = [list(getattr(point, field)) for point in message.points]
    for place, row in enumerate(rows):
        if len(row) != len(message.joint_names):
            text = f"point {place} has {len(row)} {field} for {len(message.joint_names)} joint_names"
            raise Refusal(Reason.WRONG_SIZE, text)
    return rows


def _seconds(time: object) -> float:
    """Return the seconds of a Duration message."""
    return time.sec + 1e-9 * time.nanosec
