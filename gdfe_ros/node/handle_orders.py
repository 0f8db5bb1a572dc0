# SPDX-License-Identifier: Apache-2.0
"""From a message that commands a handle to an order, or a refusal that says why not."""

from __future__ import annotations

import math

from geometry_msgs.msg import PoseStamped, TwistStamped

from gdfe_ros.constraints import Handle
from gdfe_ros.node.interface import rest_frame
from gdfe_ros.node.orders import PoseOrder, TwistOrder
from gdfe_ros.node.refusals import Reason, Refusal

UNIT_SLACK = 1e-3
FARTHEST = 10.0
"""Of the body's size: the farthest that a handle may be from rest, and the farthest that it may move in a second."""
FASTEST_TURN = 1e3
"""Fastest turn [rad/s]."""


def pose_order(message: PoseStamped, handle: Handle, *, size: float, frame_id: str) -> PoseOrder:
    """Check a target message.

    Args:
        message: of the handle.
        handle: that is commanded.
        size: of the body [m].
        frame_id: of the node.

    Raises:
        Refusal: the handle is fixed, the header names another frame, a number is not finite, the quaternion is not of
            unit length, or the translation is over ten times the body's size.
    """
    _require_movable(handle)
    _require_frame(message.header.frame_id, handle, frame_id)
    position, orientation = message.pose.position, message.pose.orientation
    translation = (position.x, position.y, position.z)
    quaternion = (orientation.x, orientation.y, orientation.z, orientation.w)
    _require_finite(position=translation, orientation=quaternion)
    norm = math.hypot(*quaternion)
    if abs(norm - 1.0) > UNIT_SLACK:
        text = f"orientation (x, y, z, w) {quaternion} has length {norm:.6g}; allowed: 1 +- {UNIT_SLACK:g}"
        raise Refusal(Reason.NOT_UNIT, text)
    require_near(translation, size)
    return PoseOrder(handle.name, translation, quaternion)


def twist_order(message: TwistStamped, handle: Handle, *, size: float, frame_id: str) -> TwistOrder:
    """Check a velocity message; arguments as for ``pose_order``.

    Raises:
        Refusal: the handle is fixed, the header names another frame, a number is not finite, or the velocity is out of
            all proportion.
    """
    _require_movable(handle)
    _require_frame(message.header.frame_id, handle, frame_id)
    linear = (message.twist.linear.x, message.twist.linear.y, message.twist.linear.z)
    angular = (message.twist.angular.x, message.twist.angular.y, message.twist.angular.z)
    _require_finite(linear=linear, angular=angular)
    if math.hypot(*linear) > FARTHEST * size:
        text = f"linear velocity {linear} m/s; allowed: {FARTHEST * size:.3g} m/s, {FARTHEST:g} body sizes a second"
        raise Refusal(Reason.TOO_FAST, text)
    if math.hypot(*angular) > FASTEST_TURN:
        raise Refusal(Reason.TOO_FAST, f"angular velocity {angular} rad/s; allowed: {FASTEST_TURN:g} rad/s")
    return TwistOrder(handle.name, linear, angular)


def require_near(translation: tuple[float, float, float], size: float) -> None:
    """Check that a target lies within reach of a body of this size [m].

    Raises:
        Refusal: it does not.
    """
    distance = math.hypot(*translation)
    if distance > FARTHEST * size:
        raise Refusal(
            Reason.TOO_FAR,
            f"position {translation} is {distance:.3g} m from rest; allowed: {FARTHEST * size:.3g} m, "
            f"{FARTHEST:g} times the body's size",
        )


def _require_movable(handle: Handle) -> None:
    if handle.fixed:
        raise Refusal(Reason.FIXED, f"handle {handle.name!r} is fixed in the scene and takes no commands")


def _require_frame(given: str, handle: Handle, frame_id: str) -> None:
    """Take the frames whose axes are the node's; the node knows no others."""
    allowed = (frame_id, rest_frame(handle.name))
    if given and given not in allowed:
        text = (
            f"header.frame_id is {given!r}; allowed: empty, {allowed[0]!r} or {allowed[1]!r}, as a target is relative "
            "to the handle's rest pose in these axes: transform it before it is sent"
        )
        raise Refusal(Reason.FRAME, text)


def _require_finite(**vectors: tuple[float, ...]) -> None:
    if not all(math.isfinite(value) for vector in vectors.values() for value in vector):
        given = " and ".join(f"{name} {vector}" for name, vector in vectors.items())
        raise Refusal(Reason.NOT_FINITE, f"{given} must be finite numbers")
