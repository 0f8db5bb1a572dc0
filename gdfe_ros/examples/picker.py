# SPDX-License-Identifier: Apache-2.0
"""A ROS node that picks objects with a soft hand on an arm.

The scene's program says where the arm moves, and when the hand is closed. The node sends the arm's trajectories as
MoveIt does. It computes the commands of the fingers from the published forces at the fingertips.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import pairwise

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import WrenchStamped
from rclpy.action import ActionClient
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from gdfe_ros.examples.soft_grip import GripSchedule
from gdfe_ros.examples.tip_follower import nanoseconds_of
from gdfe_ros.node.interface import FOLLOW_TRAJECTORY, Delivery
from gdfe_ros.node.messages import actuation
from gdfe_ros.node.middleware.ros_types import interface_class, is_installed, qos_profile
from gdfe_ros.scene.program import Program
from gdfe_ros.scene.scene import Scene

_SOON = 1e-6
"""Time [s] by which a trajectory may begin early, to allow for the rounding of times to nanoseconds."""


def motions(program: Program) -> Iterator[tuple[float, JointTrajectory]]:
    """Yield the start [s] and the trajectory of each motion of a program's joints, between two successive points."""
    names = list(program.joints)
    times = sorted({point.time for points in program.joints.values() for point in points})
    for start, end in pairwise(times):
        now, then = (program.joint_positions(time) for time in (start, end))
        if now != then:
            last = JointTrajectoryPoint(positions=[then[name] for name in names], velocities=[0.0] * len(names))
            seconds, rest = divmod(round(1e9 * (end - start)), 10**9)
            last.time_from_start = Duration(sec=seconds, nanosec=rest)
            yield start, JointTrajectory(joint_names=names, points=[last])


class Picker(Node):
    """Picks the objects of a scene's program, one after the other.

    The node answers each state of the simulation with commands of the fingers. It sends motions of the arm as goals of
    the action ``follow_joint_trajectory`` or, without control_msgs, as messages on ``~/trajectory``.

    Args:
        scene: the scene. Each actuator has a contact sensor of the same name, and closes along the x axis.
        simulation: full name of the simulation's node.
        schedule: controller of the fingers, which closes and opens them as the program does.

    Attributes:
        outcomes: error code of each trajectory that ended; 0 is success.
    """

    def __init__(self, scene: Scene, simulation: str, schedule: GripSchedule, **options: object) -> None:
        super().__init__("picker", **options)
        self._schedule = schedule
        self._actuators = {each.name: each for each in scene.actuators}
        self._motions = list(motions(scene.program))
        self._felt: dict[str, tuple[int, float]] = {}
        self.outcomes: list[int] = []
        self._commands = self.create_publisher(JointState, f"{simulation}/actuation", 10)
        for name in self._actuators:
            topic = f"{simulation}/sensors/{name}/wrench"
            self.create_subscription(WrenchStamped, topic, partial(self._feel, name), qos_profile(Delivery.STATE))
        self._action = None
        if is_installed(FOLLOW_TRAJECTORY.type):
            kind = interface_class(FOLLOW_TRAJECTORY.type)
            self._goal, self._action = kind.Goal, ActionClient(self, kind, f"{simulation}/follow_joint_trajectory")
        else:
            self.get_logger().info("control_msgs is not installed: trajectories go to ~/trajectory, not to the action")
            self._trajectories = self.create_publisher(JointTrajectory, f"{simulation}/trajectory", 10)

    def _feel(self, name: str, message: WrenchStamped) -> None:
        self._felt[name] = nanoseconds_of(message), abs(message.wrench.force.x)
        if len(self._felt) == len(self._actuators) and len({moment for moment, _ in self._felt.values()}) == 1:
            self._answer(1e-9 * self._felt[name][0])

    def _answer(self, time: float) -> None:
        """Send the motion that begins at a time [s], if any, then the fingers' commands, which start the next step."""
        if self._motions and self._motions[0][0] <= time + _SOON:
            self._move(self._motions.pop(0)[1], time)
        else:
            self._command(time)

    def _move(self, trajectory: JointTrajectory, time: float) -> None:
        if self._action is None:
            self._trajectories.publish(trajectory)
            self._command(time)
            return
        sent = self._action.send_goal_async(self._goal(trajectory=trajectory))
        sent.add_done_callback(partial(self._follow, time))

    def _follow(self, time: float, sent: object) -> None:
        """Await the end of an accepted motion in the background, and send the fingers' commands.

        A rejected goal has the error code -1.
        """
        if sent.result().accepted:
            ended = sent.result().get_result_async()
            ended.add_done_callback(lambda ended: self.outcomes.append(ended.result().result.error_code))
        else:
            self.outcomes.append(-1)
        self._command(time)

    def _command(self, time: float) -> None:
        felt = {name: force for name, (_, force) in self._felt.items()}
        self._commands.publish(actuation(self._actuators, self._schedule.commands(time, felt)))
