# SPDX-License-Identifier: Apache-2.0
"""A controller node that moves a probe to goals, with actuator commands computed from the probe's measured poses.

    python -m gdfe_ros.examples.tip_follower --ros-args -p simulation:=/gdfe_sim -p probe:=tip

It controls a ``sim_node``, or a robot with the same topics. Send goals [m] to ``~/goal``, in the frame of the probe's
poses, e.g. by ``gdfe pub /tip_follower/goal``. For each state of the robot, the node publishes the next command.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from gdfe_ros.actuators import Actuator
from gdfe_ros.control import FeedbackControl, Target
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface import Delivery
from gdfe_ros.node.messages import actuation
from gdfe_ros.node.middleware.process import answer_arguments, run
from gdfe_ros.node.middleware.ros_types import qos_profile
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command, Simulation

_PERIOD = 0.02
"""Duration of the first command to a goal [s]; later commands have the time between two states as their duration."""
_REST = 1e-4
"""Commands count as constant if they change by less than this fraction."""
_LONG = 300
"""Number of commands after which the outcome is logged, even if the commands still change."""
_ENOUGH = 1e6
"""Duration of the model's step to the commands in force [s]; it is so long that rates do not limit the commands."""


class TipFollower(Node):
    """Node that moves a probe to goals.

    The model is the scene that the simulation publishes, without dynamics. It is solved once to compute the Jacobian.
    Then measurements correct the Jacobian (`FeedbackControl`).

    Parameters: ``simulation`` (full name of the node), ``probe``, ``tolerance`` [m], ``learning`` (0 to 1) and
    ``slew_time`` [s]. ``slew_time`` is the shortest time in which a command may cross its range; it must be at least
    that of the simulation.

    Attributes:
        message: reason why the last goal is probably not reached; empty otherwise.
    """

    def __init__(self, interrupted: threading.Event | None = None, **options: object) -> None:
        super().__init__("tip_follower", **options)
        name = self.declare_parameter("simulation", "/gdfe_sim").value
        self._probe = self.declare_parameter("probe", "tip").value
        self._tolerance = float(self.declare_parameter("tolerance", 1e-5).value)
        self._slew = float(self.declare_parameter("slew_time", 2.0).value)
        self._learning = float(self.declare_parameter("learning", 0.6).value)
        self.message = ""
        self._scene: Scene | None = None
        self._control: FeedbackControl | None = None
        self._pose: PoseStamped | None = None
        self._joints: JointState | None = None
        self._goal: NDArray[np.float64] | None = None
        self._last: int | None = None
        self._told, self._answers = False, 0
        self._commands = self.create_publisher(JointState, f"{name}/actuation", 10)
        states = qos_profile(Delivery.STATE)
        self.create_subscription(String, f"{name}/scene", self._take_scene, qos_profile(Delivery.LATCHED))
        self.create_subscription(PoseStamped, f"{name}/probe/{self._probe}", self._take_pose, states)
        self.create_subscription(JointState, f"{name}/joint_states", self._take_joints, states)
        self.create_subscription(PoseStamped, "~/goal", self._take_goal, 10)

    def close(self) -> None:
        """Do nothing; `run` requires this method."""

    def _take_scene(self, message: String) -> None:
        if self._scene is None:
            self._scene = scene_from_text(message.data, overrides={"dynamics": None})
            self._answer()

    def _take_pose(self, message: PoseStamped) -> None:
        self._pose = message
        self._answer()

    def _take_joints(self, message: JointState) -> None:
        self._joints = message
        self._answer()

    def _take_goal(self, message: PoseStamped) -> None:
        own, frame = self._pose.header.frame_id if self._pose else "", message.header.frame_id
        if own and frame and frame != own:
            self.get_logger().error(f"goal in frame {frame!r} is ignored; poses of {self._probe} are in {own!r}")
            return
        position = message.pose.position
        self._goal = np.array([[position.x, position.y, position.z]])
        self._told, self._answers, self._last = False, 0, None  # the goal is answered even if the state is not new
        self._answer()

    def _answer(self) -> None:
        """Publish the next command if the pose and the joint states of a new step have arrived."""
        if self._scene is None or self._pose is None or self._joints is None or self._goal is None:
            return
        stamp = nanoseconds_of(self._pose)
        if stamp != nanoseconds_of(self._joints) or stamp == self._last:
            return
        dt, self._last = _PERIOD if self._last is None else 1e-9 * (stamp - self._last), stamp
        position, applied = self._pose.pose.position, read_commands(self._joints, self._scene.actuators)
        try:
            if self._control is None:
                self._control = self._make_control(applied)
            self._control.observe([[position.x, position.y, position.z]], applied)
            found = self._control.command(self._goal, max(dt, 1e-6))
        except GdfeError as error:
            self.get_logger().error(str(error))
            return
        self.message = found.message
        rests = all(np.isclose(found.commands[name], applied[name], rtol=_REST, atol=0.0) for name in found.commands)
        self._answers += 1
        if (found.reached or rests or self._answers > _LONG) and not self._told:
            self._told = True
            self.get_logger().info("the goal is reached" if found.reached else found.message or "not reached yet")
        actuators = {actuator.name: actuator for actuator in self._scene.actuators}
        self._commands.publish(actuation(actuators, found.commands))

    def _make_control(self, applied: dict[str, float]) -> FeedbackControl:
        """Return the controller, with a model that has been solved at the commands in force."""
        model = Simulation(self._scene)
        model.step(Command(actuators=applied), dt=_ENOUGH)
        given = {"tolerance": self._tolerance, "learning": self._learning, "slew": self._slew}
        return FeedbackControl(model, [Target(probe=self._probe)], **given)


def read_commands(joints: JointState, actuators: Sequence[Actuator]) -> dict[str, float]:
    """Return a dict from actuator to its command in force, from the simulation's joint states."""
    values = {each.name: joints.effort if each.mode.by_effort else joints.position for each in actuators}
    return {name: numbers[joints.name.index(name)] for name, numbers in values.items()}


def nanoseconds_of(message: PoseStamped | JointState | WrenchStamped) -> int:
    """Return the stamp of a message's header [ns]."""
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def main(args: list[str] | None = None) -> int:
    """Run the controller until SIGINT or SIGTERM."""
    answered = answer_arguments("tip_follower", f"usage: tip_follower [--help] [--ros-args ...]\n\n{__doc__}", args)
    return run(TipFollower, args) if answered is None else answered


if __name__ == "__main__":
    raise SystemExit(main())
