# SPDX-License-Identifier: Apache-2.0
"""A topic in a bag: its type and the quality of service that its publisher offered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from gdfe_ros.errors import RecordingError

# rosbag2 writes "no deadline" as the largest rmw_time_t.
_INFINITE = {"sec": 9223372036, "nsec": 854775807}


class Reliability(Enum):
    """Whether lost messages are resent."""

    RELIABLE = "reliable"
    BEST_EFFORT = "best_effort"
    SYSTEM_DEFAULT = "system_default"
    BEST_AVAILABLE = "best_available"
    UNKNOWN = "unknown"


class Durability(Enum):
    """Whether a late subscriber receives the last messages, as of a latched topic."""

    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"
    SYSTEM_DEFAULT = "system_default"
    BEST_AVAILABLE = "best_available"
    UNKNOWN = "unknown"


class QueueExtent(Enum):
    """Whether a publisher's queue contains the last messages or all messages."""

    KEEP_LAST = "keep_last"
    KEEP_ALL = "keep_all"
    SYSTEM_DEFAULT = "system_default"
    UNKNOWN = "unknown"


@dataclass(frozen=True, kw_only=True)
class Qos:
    """Quality of service of a publisher; rosbag2 stores it, and ``ros2 bag play`` offers it again.

    Args:
        reliability: whether lost messages are resent.
        durability: ``TRANSIENT_LOCAL`` for a latched topic.
        history: extent of the publisher's queue.
        depth: number of messages in the queue under ``KEEP_LAST``, at least 0.

    Raises:
        ValueError: the depth is negative.
    """

    reliability: Reliability = Reliability.RELIABLE
    durability: Durability = Durability.VOLATILE
    history: QueueExtent = QueueExtent.KEEP_LAST
    depth: int = 10

    def __post_init__(self) -> None:
        if self.depth < 0:
            raise ValueError(f"qos depth is {self.depth}; allowed: 0 or more")

    @classmethod
    def from_rclpy(cls, profile: Any) -> Qos:
        """Return the profile of an ``rclpy.qos.QoSProfile``, by the names of its policies; rclpy is not imported."""
        return cls(
            reliability=Reliability[profile.reliability.name],
            durability=Durability[profile.durability.name],
            history=QueueExtent[profile.history.name],
            depth=profile.depth,
        )

    @classmethod
    def from_rosbag2(cls, entry: Mapping[str, Any]) -> Qos:
        """Return the profile from a mapping as in metadata.yaml, version 9.

        Raises:
            RecordingError: a policy is not one of the names that ROS 2 has written since Jazzy.
        """
        try:
            return cls(
                reliability=Reliability(entry["reliability"]),
                durability=Durability(entry["durability"]),
                history=QueueExtent(entry["history"]),
                depth=entry["depth"],
            )
        except (KeyError, ValueError) as error:
            raise RecordingError(
                f"quality of service {dict(entry)} is not as ROS 2 writes it since Jazzy: {error!r}"
            ) from error

    def to_rosbag2(self) -> dict[str, Any]:
        """Return the profile as a mapping as in metadata.yaml, version 9."""
        return {
            "history": self.history.value,
            "depth": self.depth,
            "reliability": self.reliability.value,
            "durability": self.durability.value,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }


@dataclass(frozen=True, kw_only=True)
class TopicInfo:
    """One topic of a bag.

    Args:
        name: full topic name, e.g. ``/gdfe_sim/mesh``.
        type: ROS type, e.g. ``sensor_msgs/msg/PointCloud2``.
        qos: profile that the publisher offered.
        definition: concatenated ``.msg`` texts; if empty, the writer takes them from the ROS installation.
        type_hash: hash ``RIHS01_...`` of the type; if empty, the writer takes it from the ROS installation.
        role: name of the topic relative to the recording node, without remapping, e.g. ``mesh`` or
            ``handles/tip/pose``; empty if unknown.
    """

    name: str
    type: str
    qos: Qos = field(default_factory=Qos)
    definition: str = ""
    type_hash: str = ""
    role: str = ""
