# SPDX-License-Identifier: Apache-2.0
"""Convert command messages for handles, obstacles and rigid bodies to orders, and refuse invalid ones with a reason."""

from __future__ import annotations

import math

from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, TwistStamped

from gdfe_ros.constraints import Handle
from gdfe_ros.node.frames import Frames, Placement
from gdfe_ros.node.orders import FARTHEST, PoseOrder, TeleportOrder, TwistOrder, require_near
from gdfe_ros.node.refusals import Reason, Refusal, require_finite, require_unit

UNIT_SLACK = 1e-3
"""Largest allowed difference between a quaternion's length and 1."""
FASTEST_TURN = 1e3
"""Largest allowed angular velocity [rad/s]."""
Vector, Quaternion = tuple[float, float, float], tuple[float, float, float, float]


def pose_order(message: PoseStamped, handle: Handle, *, size: float, frames: Frames) -> PoseOrder:
    """Return the order of a message with a target pose.

    Args:
        message: target pose.
        handle: the commanded handle.
        size: size of the body [m].
        frames: frames of the body. In the node's frame and the handle's rest frame, the target is relative to the rest
            pose. In any other frame, it is the pose of the handle's own frame in that frame.

    Raises:
        Refusal: the handle is fixed, no transforms lead to the header's frame, a number is not finite, the quaternion
            is not of unit length, or the translation exceeds ten times the body's size.
    """
    _require_movable(handle)
    return PoseOrder(handle.name, *_given(message, handle, size, frames))


def put_order(message: PoseStamped, handle: Handle, *, size: float, frames: Frames) -> TeleportOrder:
    """Return the order to teleport a rigid body; arguments as for ``pose_order``.

    Raises:
        Refusal: as for ``pose_order``, except for fixed handles.
    """
    return TeleportOrder(handle.name, *_given(message, handle, size, frames))


def placed_order(handle: Handle, place: Placement, *, size: float, frames: Frames) -> PoseOrder:
    """Return the order that moves a handle's frame to ``place`` in the node's frame; ``size`` is the body's size [m].

    Raises:
        Refusal: the place is farther from rest than ten times the body's size.
    """
    rest = frames.rests()[frames.rest(handle.name)]
    return PoseOrder(handle.name, *_near(rest.inverse() @ place, size))


def require_pose(pose: PoseMessage) -> Placement:
    """Check a pose message and return its placement.

    Raises:
        Refusal: a number is not finite, or the quaternion is not of unit length.
    """
    _checked(pose)
    return Placement.of(pose.position, pose.orientation)


def _checked(pose: PoseMessage) -> tuple[Vector, Quaternion]:
    """Check a pose message and return its translation [m] and its quaternion (x, y, z, w).

    Raises:
        Refusal: a number is not finite, or the quaternion is not of unit length.
    """
    position, orientation = pose.position, pose.orientation
    translation = (position.x, position.y, position.z)
    quaternion = (orientation.x, orientation.y, orientation.z, orientation.w)
    require_finite(position=translation, orientation=quaternion)
    require_unit(UNIT_SLACK, orientation=quaternion)
    return translation, quaternion


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
    if math.hypot(*linear) > FARTHEST * size:
        text = f"linear velocity {linear} m/s; allowed: {FARTHEST * size:.3g} m/s, {FARTHEST:g} body sizes a second"
        raise Refusal(Reason.TOO_FAST, text)
    if math.hypot(*angular) > FASTEST_TURN:
        raise Refusal(Reason.TOO_FAST, f"angular velocity {angular} rad/s; allowed: {FASTEST_TURN:g} rad/s")
    if place is not None:
        linear, angular = (tuple(place.turn.apply(vector).tolist()) for vector in (linear, angular))
    return TwistOrder(handle.name, linear, angular)


def _given(message: PoseStamped, handle: Handle, size: float, frames: Frames) -> tuple[Vector, Quaternion]:
    """Return a message's translation from rest [m] and quaternion, bitwise as sent if they need no transform."""
    place = frames.relative(message.header.frame_id, handle.name)
    if place is not None:
        return _near(place @ require_pose(message.pose), size)
    translation, quaternion = _checked(message.pose)
    require_near(translation, size)
    return translation, quaternion


def _near(place: Placement, size: float) -> tuple[Vector, Quaternion]:
    """Return translation [m] and quaternion of a placement relative to rest; refuse it if it is too far from rest."""
    translation = tuple(place.origin.tolist())
    require_near(translation, size)
    return translation, tuple(place.turn.as_quat().tolist())


def _require_movable(handle: Handle) -> None:
    if handle.carrier:
        text = f"arm {handle.carrier!r} carries {handle.noun} {handle.name!r}, which takes no commands of its own"
        raise Refusal(Reason.FOLLOWS, f"{text}; remedy: command the arm's joints on ~/joint_command or ~/trajectory")
    if handle.fixed:
        text = f"{handle.noun} {handle.name!r} is fixed in the scene and takes no commands"
        remedy = f"put {handle.section}.{handle.name}.fixed=false into scene_overrides"
        raise Refusal(Reason.FIXED, f"{text}; remedy: {remedy}")
