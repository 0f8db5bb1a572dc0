# SPDX-License-Identifier: Apache-2.0
"""One output topic: published to whoever listens, recorded where asked, serialised once for both."""

from __future__ import annotations

from typing import Any

from rclpy.lifecycle import LifecycleNode
from rclpy.serialization import serialize_message

from gdfe_ros.node.qos import interface_class, qos_profile
from gdfe_ros.node.specification import Delivery, TopicSpec
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.topic import Qos, TopicInfo


class Channel:
    """A publisher and the recording of its topic.

    Args:
        node: that publishes.
        spec: of the topic.
        names: for the braces in the topic's name, e.g. ``handle="tip"``.

    Attributes:
        info: describes the topic for a bag.
        recorded: whether bags hold it.
        recorder: of the bag in progress, or None.
    """

    def __init__(self, node: LifecycleNode, spec: TopicSpec, **names: str) -> None:
        self._node, self.recorded = node, spec.recorded
        profile = qos_profile(spec.delivery)
        # Latched topics and diagnostics speak while the node is not active, too.
        managed = spec.name.startswith("~") and spec.delivery is not Delivery.LATCHED
        make = node.create_lifecycle_publisher if managed else node.create_publisher
        self._publisher = make(interface_class(spec.type), spec.name.format(**names), profile)
        role = spec.name.format(**names).removeprefix("~/")
        name, qos = self._publisher.topic_name, Qos.from_rclpy(profile)
        self.info = TopicInfo(name=name, type=spec.type, qos=qos, role=role)
        self.recorder: Recorder | None = None

    @property
    def wanted(self) -> bool:
        """Whether anybody listens or a bag is written; otherwise no message need be built."""
        return self.recorder is not None or self._publisher.get_subscription_count() > 0

    def send(self, message: Any, log_time: int) -> None:
        """Serialise, publish and record a message.

        Args:
            message: of the topic's type, or bytes that are serialised already.
            log_time: for the bag [ns].
        """
        data = message if isinstance(message, bytes) else serialize_message(message)
        self._publisher.publish(data)
        if self.recorder is not None:
            self.recorder.record(self.info.name, data, log_time)

    def destroy(self) -> None:
        """Take the topic off the graph."""
        self._node.destroy_lifecycle_publisher(self._publisher)
