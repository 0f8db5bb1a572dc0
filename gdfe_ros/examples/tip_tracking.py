# SPDX-License-Identifier: Apache-2.0
"""A controller node that moves a probe of a running simulation along a circle.

    ros2 launch gdfe_ros control_loop.launch.py

Or run ``tip_tracking`` and a ``sim_node`` with the scene ``three_chamber_arm``. The controller requests the Jacobian
once. Then it publishes the next command for every pose of the probe. In lockstep, the simulation waits for this
command. Under the wall clock, the controller works at the rate of the simulation. It reads the commands in force from
the joint states of the same step. Therefore late poses, and late or lost commands, do no harm.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from gdfe_ros.examples.tip_follower import nanoseconds_of, read_commands
from gdfe_ros.examples.tip_tracker import TipTracker, circle
from gdfe_ros.node.interface import Delivery
from gdfe_ros.node.middleware.process import answer_arguments, run
from gdfe_ros.node.middleware.ros_types import qos_profile
from gdfe_ros.scene.loader import scene_from_text

_BASELINE, _REACH = 0.06, 0.2
"""Least motion that corrects the Jacobian, and largest motion of one command, both divided by the radius."""
_FIRST = 0.02
"""Largest delay that is assumed before the delay of a command has been measured, divided by the period."""
_LOOK = 0.2
"""Time [s] between two checks whether a request or command has no answer."""


class TipTracking(Node):
    """Node that moves a probe along a circle in the y-z plane; the probe's first position is the circle's lowest point.

    Parameters: ``simulation`` (full name of the node), ``probe``, ``radius`` [m], ``period`` [s] on the clock of the
    poses' stamps, ``gain``, and ``patience`` [s]. If there is no answer for ``patience`` seconds of wall time, the
    node repeats its request or command.

    Attributes:
        errors: distance [m] of the probe from its goal in the y-z plane, in each step since the start.
    """

    def __init__(self, interrupted: threading.Event | None = None, **options: object) -> None:
        super().__init__("tip_tracking", **options)
        name = self.declare_parameter("simulation", "/gdfe_sim").value
        self._probe = self.declare_parameter("probe", "tip").value
        self._radius = float(self.declare_parameter("radius", 0.005).value)
        self._period = float(self.declare_parameter("period", 2.0).value)
        self._gain = float(self.declare_parameter("gain", 1.0).value)
        self._patience = float(self.declare_parameter("patience", 30.0).value)
        self.errors: list[float] = []
        self._scene = self._tracker = self._start = self._waiting_since = None
        self._parts: dict[int, dict[type, Any]] = {}
        self._sent: deque[tuple[float, NDArray[np.float64]]] = deque(maxlen=100)
        self._applied: NDArray[np.float64] | None = None
        self._text = ""
        self._delays: deque[float] = deque(maxlen=9)
        self._last = self._ahead = 0.0
        self._commands = self.create_publisher(Float64MultiArray, f"{name}/commands", 10)
        self._jacobian = self.create_client(Trigger, f"{name}/compute_jacobian")
        latched, states = qos_profile(Delivery.LATCHED), qos_profile(Delivery.STATE)
        self.create_subscription(String, f"{name}/scene", self._take_scene, latched)
        self.create_subscription(Float64MultiArray, f"{name}/jacobian", self._take_jacobian, latched)
        self.create_subscription(PoseStamped, f"{name}/probe/{self._probe}", self._take_state, states)
        self.create_subscription(JointState, f"{name}/joint_states", self._take_state, states)
        self.create_timer(_LOOK, self._look)

    def close(self) -> None:
        """Log the number of steps and the largest error."""
        if self.errors:
            worst, radius = 1e3 * max(self.errors), 1e3 * self._radius
            self.get_logger().info(f"{len(self.errors)} steps, largest error {worst:.3f} mm, radius {radius:g} mm")

    def _look(self) -> None:
        """Request the Jacobian once the simulation is connected; repeat a request or command without an answer."""
        waited = time.monotonic() - (self._waiting_since or -np.inf)
        if waited < self._patience:
            return
        # A state has arrived, so that the simulation has discovered this node.
        ready = self._applied is not None and self._jacobian.service_is_ready()
        if self._tracker is None and ready and self._commands.get_subscription_count():
            self._waiting_since = time.monotonic()
            self._jacobian.call_async(Trigger.Request()).add_done_callback(self._warn_of_failure)
        elif self._tracker is not None:
            self.get_logger().warning(f"no pose for {waited:.0f} s; the last command is sent again")
            self._send(self._sent[-1][1])

    def _warn_of_failure(self, future: Any) -> None:
        response = future.result()
        if not response.success:
            self.get_logger().warning(f"no Jacobian: {response.message}")

    def _take_scene(self, message: String) -> None:
        if message.data == self._text:  # published again, e.g. for a bag
            return
        self._text, self._scene = message.data, scene_from_text(message.data)
        self._tracker = self._start = self._waiting_since = self._applied = None
        self._take_whole()

    def _take_jacobian(self, message: Float64MultiArray) -> None:
        if self._tracker is not None or self._waiting_since is None:  # a latched one that this node did not request
            return
        actuators = self._scene.actuators
        shape = [dimension.size for dimension in message.layout.dim]
        place = list(self._scene.probes).index(self._probe)
        self._tracker = TipTracker(
            np.array(message.data).reshape(shape)[place, 1:],
            self._applied,
            low=[actuator.low for actuator in actuators],
            high=[actuator.high for actuator in actuators],
            axes=(1, 2),
            gain=self._gain,
            baseline=_BASELINE * self._radius,
            reach=_REACH * self._radius,
        )
        # The last pose may be old. Repeat the command in force, so that the simulation makes a step.
        self._parts.clear()
        self._sent.append((-np.inf, self._applied))
        self._send(self._applied)

    def _send(self, command: NDArray[np.float64]) -> None:
        self._waiting_since = time.monotonic()
        self._commands.publish(Float64MultiArray(data=list(command)))

    def _take_state(self, message: PoseStamped | JointState) -> None:
        """Store a message by its stamp, and process the steps whose pose and joint states have both arrived."""
        self._parts.setdefault(nanoseconds_of(message), {})[type(message)] = message
        self._take_whole()

    def _take_whole(self) -> None:
        """Process steps with both messages, if the scene has arrived; drop earlier steps with only one message."""
        if self._scene is None:
            return
        for stamp in sorted(stamp for stamp, parts in self._parts.items() if len(parts) == 2):
            parts = self._parts[stamp]
            self._parts = {later: kept for later, kept in self._parts.items() if later > stamp}
            self._applied = np.array(list(read_commands(parts[JointState], self._scene.actuators).values()))
            last, self._last = self._last, 1e-9 * stamp
            if self._tracker is not None:
                position = parts[PoseStamped].pose.position
                self._follow(np.array([position.x, position.y, position.z]), self._last, last)

    def _follow(self, tip: NDArray[np.float64], now: float, last: float) -> None:
        """Send the next command after the step at the time ``now`` [s]; the previous step was at ``last`` [s]."""
        if self._start is None or now < last:  # also after a reset of the simulation
            self._start, self._centre = now, tip + np.array([0.0, 0.0, self._radius])
            # Until the delay of a command is measured, one step is assumed.
            self._ahead = min(max(now - last, 0.0), _FIRST * self._period)
            self._delays.clear()
            self._tracker.forget()
        self.errors.append(float(np.linalg.norm((tip - self._goal(now))[1:])))
        self._note_delay(now)
        command = self._tracker.command(tip, self._goal(now + self._ahead), self._applied)
        self._sent.append((now, command))
        self._send(command)

    def _goal(self, moment: float) -> NDArray[np.float64]:
        return circle(self._centre, self._radius, (moment - self._start) / self._period)

    def _note_delay(self, now: float) -> None:
        """Measure the time from sending the command in force to this step, and update the median of recent delays."""
        for sent, command in reversed(self._sent):
            if self._start <= sent < now and np.allclose(command, self._applied, rtol=1e-9, atol=0.0):
                self._delays.append(now - sent)
                self._ahead = float(np.median(self._delays))
                return


def main(args: list[str] | None = None) -> int:
    """Run the controller until SIGINT or SIGTERM."""
    answered = answer_arguments("tip_tracking", f"usage: tip_tracking [--help] [--ros-args ...]\n\n{__doc__}", args)
    return run(TipTracking, args) if answered is None else answered


if __name__ == "__main__":
    raise SystemExit(main())
