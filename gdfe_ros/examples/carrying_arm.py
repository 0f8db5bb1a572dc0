# SPDX-License-Identifier: Apache-2.0
"""An arm that carries a soft gripper: it publishes the pose of its tool, and the gripper's wrist follows this pose.

The arm has two links in the x-z plane. Its tool is at the end of the second link. The tool starts at the rest pose of
the wrist. Periodically, it lifts the gripper, turns it downward, and returns. ``gripper_on_arm.launch.py`` starts the
arm and the gripper, with the parameter::

    follow: ["wrist=topic:/carrying_arm/tool_pose"]
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from gdfe_ros.node.middleware.process import answer_arguments, run

LINKS = (0.30, 0.20)
"""Lengths of the links [m]."""
_SHOULDER = np.array([-LINKS[1], 0.0, -LINKS[0]])
"""Position of the shoulder [m]; with the first link upright and the second along x, the tool is at the origin."""
_LIFT, _HANG = -0.3, 1.4
"""Largest rotations about y of the shoulder and of the tool [rad]."""


def joints_at(phase: float) -> tuple[float, float, float]:
    """Return the angles of shoulder, elbow and wrist [rad] at a ``phase`` of the motion, whose period is 1."""
    share = 0.5 - 0.5 * np.cos(2.0 * np.pi * phase)
    return _LIFT * share, -_LIFT * share, _HANG * share


def tool_at(joints: tuple[float, float, float]) -> tuple[NDArray[np.float64], Rotation]:
    """Return the pose of the tool: its origin (3,) [m] and its rotation."""
    shoulder, elbow, wrist = joints
    first, second = (Rotation.from_rotvec([0.0, turn, 0.0]) for turn in (shoulder, shoulder + elbow))
    origin = _SHOULDER + first.apply([0.0, 0.0, LINKS[0]]) + second.apply([LINKS[1], 0.0, 0.0])
    return origin, second * Rotation.from_rotvec([0.0, wrist, 0.0])


class CarryingArm(Node):
    """Publishes ``~/tool_pose`` and ``~/joint_states``; parameters ``period`` [s], ``rate`` [Hz] and ``frame_id``."""

    def __init__(self, *_: Any, **options: Any) -> None:
        super().__init__("carrying_arm", **options)
        self._period = float(self.declare_parameter("period", 8.0).value)
        self._frame = self.declare_parameter("frame_id", "base_link").value
        rate = float(self.declare_parameter("rate", 50.0).value)
        self._poses = self.create_publisher(PoseStamped, "~/tool_pose", 10)
        self._joints = self.create_publisher(JointState, "~/joint_states", 10)
        self._started = time.monotonic()
        self.create_timer(1.0 / rate, self._tell, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def close(self) -> None:
        """Do nothing; `run` requires this method."""

    def _tell(self) -> None:
        joints = joints_at((time.monotonic() - self._started) / self._period)
        origin, turn = tool_at(joints)
        message = PoseStamped()
        message.header.frame_id = self._frame
        place, quaternion = message.pose.position, message.pose.orientation
        place.x, place.y, place.z = map(float, origin)
        quaternion.x, quaternion.y, quaternion.z, quaternion.w = map(float, turn.as_quat())
        self._poses.publish(message)
        state = JointState(name=["shoulder", "elbow", "wrist"], position=list(map(float, joints)))
        state.header.stamp = self.get_clock().now().to_msg()
        self._joints.publish(state)


def main(args: list[str] | None = None) -> int:
    """Run the arm until SIGINT or SIGTERM."""
    answered = answer_arguments("carrying_arm", f"usage: carrying_arm [--help] [--ros-args ...]\n\n{__doc__}", args)
    return run(CarryingArm, args) if answered is None else answered


if __name__ == "__main__":
    raise SystemExit(main())
