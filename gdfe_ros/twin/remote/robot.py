# SPDX-License-Identifier: Apache-2.0
"""The topics of a real robot: its commands, and the measured poses of points on it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from threading import Event, Thread
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PointStamped, PoseStamped
from rclpy.context import Context
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.command_messages import ActuatorOrders
from gdfe_ros.node.managed import EventlessNode
from gdfe_ros.node.process import make_executor
from gdfe_ros.node.refusals import Refusal, RefusalLog
from gdfe_ros.twin.twin import Twin

_TYPES = {"geometry_msgs/msg/PoseStamped": PoseStamped, "geometry_msgs/msg/PointStamped": PointStamped}


class Robot:
    """Passes the commands and the measurements of a robot to its twin.

    Args:
        twin: the simulation beside the robot.
        commands: topic of the robot's commands, a ``sensor_msgs/msg/JointState`` as on ``~/actuation``.
        measured: dict from probe to the topic of its measured pose or point, in the frame of the scene.
        patience: longest wait for the types of these topics [s].
        warn: function that receives texts about refused messages.

    Raises:
        GdfeError: nobody publishes a measured topic, or with another type.
    """

    def __init__(
        self,
        twin: Twin,
        *,
        commands: str,
        measured: Mapping[str, str],
        patience: float,
        warn: Callable[[str], None],
    ) -> None:
        self._twin, scene = twin, twin.session.scene
        self._refusals = RefusalLog(warn)
        joints = [joint for arm in scene.arms for joint in arm.joints]
        self._orders = ActuatorOrders(scene.actuators, [load.name for load in scene.loads], joints)
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = EventlessNode("gdfe_twin", context=self._context)
        try:
            kinds = {probe: self._type_of(topic, patience) for probe, topic in measured.items()}
        except GdfeError:
            self._destroy()
            raise
        self._node.create_subscription(JointState, commands, self._command, 10)
        for probe, topic in measured.items():
            self._node.create_subscription(
                kinds[probe], topic, lambda message, probe=probe: self._measure(probe, message), qos_profile_sensor_data
            )
        self._executor = make_executor(self._context)
        self._executor.add_node(self._node)
        self._ending = Event()
        self._thread = Thread(target=self._spin, name="robot", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the reception."""
        self._ending.set()
        self._thread.join()
        self._executor.shutdown()
        self._destroy()

    def _spin(self) -> None:
        while not self._ending.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def _destroy(self) -> None:
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def _type_of(self, topic: str, patience: float) -> type:
        """Return the class of the messages of a topic, as soon as it has a publisher."""
        end, name = time.monotonic() + patience, self._node.resolve_topic_name(topic)
        while not (publishers := self._node.get_publishers_info_by_topic(name)):
            if time.monotonic() > end:
                raise GdfeError(f"nobody publishes {name} within {patience:g} s; remedy: start the robot first")
            time.sleep(0.05)
        kind = publishers[0].topic_type
        if kind not in _TYPES:
            raise GdfeError(f"topic {name} has the type {kind}; allowed: {', '.join(_TYPES)}")
        return _TYPES[kind]

    def _command(self, message: JointState) -> None:
        try:
            self._twin.command(self._orders.from_joint_state(message).values)
        except Refusal as refusal:
            self._refusals.refuse("the robot's commands", refusal)

    def _measure(self, probe: str, message: Any) -> None:
        place, stamp = message.pose.position if hasattr(message, "pose") else message.point, message.header.stamp
        seconds = stamp.sec + 1e-9 * stamp.nanosec
        self._twin.measure(seconds or time.time(), probe, np.array([place.x, place.y, place.z]))
