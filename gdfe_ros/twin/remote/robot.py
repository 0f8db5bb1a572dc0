# SPDX-License-Identifier: Apache-2.0
"""The topics of a real robot: its commands, and the measured poses of points on it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from threading import Event, Thread
from typing import Any

import numpy as np
from geometry_msgs.msg import PointStamped, PoseStamped
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.command_messages import ActuatorOrders
from gdfe_ros.node.inputs import read_message
from gdfe_ros.node.interface import FRAME
from gdfe_ros.node.middleware.process import LoneNode
from gdfe_ros.node.refusals import Refusal, RefusalLog
from gdfe_ros.twin.twin import Twin
from gdfe_ros.untrusted.bounded_text import shorten

_TYPES = {"geometry_msgs/msg/PoseStamped": PoseStamped, "geometry_msgs/msg/PointStamped": PointStamped}


class Robot:
    """Subscriber that passes the commands and the measurements of a robot to its twin.

    Args:
        twin: the simulation beside the robot.
        commands: topic of the robot's commands, a ``sensor_msgs/msg/JointState`` as on ``~/actuation``.
        measured: dict from probe to the topic of its measured pose or point, in the frame of the scene.
        patience: longest wait for a publisher of each measured topic [s].
        warn: function that receives texts about refused messages.

    Raises:
        GdfeError: nobody publishes a measured topic, or with another type.
    """

    def __init__(
        self, twin: Twin, *, commands: str, measured: Mapping[str, str], patience: float, warn: Callable[[str], None]
    ) -> None:
        self._twin, scene = twin, twin.session.scene
        self._warn, self._refusals = warn, RefusalLog(warn, noun="message")
        self._framed: set[str] = set()
        self._orders = ActuatorOrders(scene)
        self._ros = LoneNode("gdfe_twin")
        self._node = self._ros.node
        try:
            kinds = {probe: self._type_of(topic, patience) for probe, topic in measured.items()}
        except GdfeError:
            self._ros.close()
            raise
        self._listen(commands, JointState, self._command, 10)
        for probe, topic in measured.items():
            self._listen(topic, kinds[probe], partial(self._measure, probe, topic), qos_profile_sensor_data)
        self._ending = Event()
        self._thread = Thread(target=self._spin, name="robot", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the reception."""
        self._ending.set()
        self._thread.join()
        self._ros.close()

    def _spin(self) -> None:
        while not self._ending.is_set():
            self._ros.executor.spin_once(timeout_sec=0.05)

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

    def _listen(self, topic: str, kind: type, take: Callable[[Any], None], qos: QoSProfile | int) -> None:
        """Pass the messages of a topic to ``take``; they arrive as bytes, so that large ones are refused undecoded."""

        def receive(data: bytes) -> None:
            try:
                take(read_message(data, kind))
            except Refusal as refusal:
                self._refusals.refuse(topic, refusal)

        self._node.create_subscription(kind, topic, receive, qos, raw=True)

    def _command(self, message: JointState) -> None:
        self._twin.command(self._orders.from_joint_state(message).values)

    def _measure(self, probe: str, topic: str, message: Any) -> None:
        place, header = message.pose.position if hasattr(message, "pose") else message.point, message.header
        if header.frame_id not in ("", FRAME) and topic not in self._framed:
            self._framed.add(topic)
            frame = shorten(header.frame_id, 80)
            self._warn(
                f"positions on {topic} have the frame {frame!r}; they are taken as given in the scene's, {FRAME!r}"
            )
        seconds = header.stamp.sec + 1e-9 * header.stamp.nanosec
        self._twin.measure(seconds or time.time(), probe, np.array([place.x, place.y, place.z]))
