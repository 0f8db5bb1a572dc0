# SPDX-License-Identifier: Apache-2.0
"""A controller node: leads a probe of a running simulation round a circle.

    ros2 launch gdfe_ros control_loop.launch.py

or, beside a ``sim_node`` that runs ``three_chamber_arm``: ``tip_tracking``. It asks for the Jacobian once, then answers
every pose of the probe with the next command: in lockstep the two take turns, under the wall clock they run at the
simulation's rate.
"""

from __future__ import annotations

import threading

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from gdfe_ros.examples.tip_tracker import TipTracker, circle
from gdfe_ros.node.process import run
from gdfe_ros.scene.loader import scene_from_text

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class TipTracking(Node):
    """Leads a probe round a circle in the y-z plane above its first position.

    Parameters: ``simulation`` (full name of the node), ``probe``, ``radius`` [m], ``period`` [s] of simulation time,
    ``gain``.

    Attributes:
        errors: distance [m] of the probe to its goal, of every step since the start.
    """

    def __init__(self, interrupted: threading.Event | None = None, **options: object) -> None:
        super().__init__("tip_tracking", **options)
        name = self.declare_parameter("simulation", "/gdfe_sim").value
        self._probe = self.declare_parameter("probe", "tip").value
        self._radius = float(self.declare_parameter("radius", 0.005).value)
        self._period = float(self.declare_parameter("period", 2.0).value)
        self._gain = float(self.declare_parameter("gain", 1.0).value)
        self.errors: list[float] = []
        self._scene = self._tracker = self._goal = self._start = None
        self._heard = self._asked = False
        self._commands = self.create_publisher(Float64MultiArray, f"{name}/commands", 10)
        self._jacobian = self.create_client(Trigger, f"{name}/compute_jacobian")
        self.create_subscription(String, f"{name}/scene", self._take_scene, _LATCHED)
        self.create_subscription(Float64MultiArray, f"{name}/jacobian", self._take_jacobian, _LATCHED)
        self.create_subscription(PoseStamped, f"{name}/probe/{self._probe}", self._take_pose, _LATCHED)
        self.create_timer(0.2, self._ask)

    def close(self) -> None:
        """Say how well it went."""
        if self.errors:
            worst, radius = 1e3 * max(self.errors), 1e3 * self._radius
            self.get_logger().info(f"{len(self.errors)} steps, farthest from the goal {worst:.3f} mm of {radius:g} mm")

    def _ask(self) -> None:
        """Ask for the Jacobian once all is connected: who has heard a pose is known to the simulation."""
        ready = self._scene is not None and self._heard and self._jacobian.service_is_ready()
        if ready and not self._asked and self._commands.get_subscription_count():
            self._asked = True
            self._jacobian.call_async(Trigger.Request()).add_done_callback(self._answered)

    def _answered(self, future: object) -> None:
        response = future.result()
        if not response.success:
            self.get_logger().warning(f"no Jacobian: {response.message}")
            self._asked = False

    def _take_scene(self, message: String) -> None:
        self._scene = scene_from_text(message.data)

    def _take_jacobian(self, message: Float64MultiArray) -> None:
        if self._tracker is not None or not self._asked:  # a latched one was not asked for by this node
            return
        actuators = self._scene.actuators
        shape = [dimension.size for dimension in message.layout.dim]
        place = list(self._scene.probes).index(self._probe)
        self._tracker = TipTracker(
            np.array(message.data).reshape(shape)[place, 1:],
            np.zeros(len(actuators)),
            low=[actuator.low for actuator in actuators],
            high=[actuator.high for actuator in actuators],
            axes=(1, 2),
            gain=self._gain,
        )
        # The pose that was heard may be old: ask for a step by repeating the neutral command.
        self._commands.publish(Float64MultiArray(data=[0.0] * len(actuators)))

    def _take_pose(self, message: PoseStamped) -> None:
        self._heard = True
        if self._tracker is None:
            return
        position, stamp = message.pose.position, message.header.stamp
        tip, now = np.array([position.x, position.y, position.z]), stamp.sec + 1e-9 * stamp.nanosec
        if self._start is None:
            self._start, self._last = now, now
            self._centre = tip + np.array([0.0, 0.0, self._radius])
        if self._goal is not None:
            self.errors.append(float(np.linalg.norm((tip - self._goal)[1:])))
        ahead = now + max(now - self._last, 0.0)
        self._last = now
        self._goal = circle(self._centre, self._radius, (ahead - self._start) / self._period)
        self._commands.publish(Float64MultiArray(data=list(self._tracker.command(tip, self._goal))))


def main(args: list[str] | None = None) -> int:
    """Run the controller until SIGINT or SIGTERM."""
    return run(TipTracking, args)


if __name__ == "__main__":
    raise SystemExit(main())
