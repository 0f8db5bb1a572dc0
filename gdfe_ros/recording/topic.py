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
    """Whether a late subscriber receives the last messages (latched)."""

    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"
    SYSTEM_DEFAULT = "system_default"
    BEST_AVAILABLE = "best_available"
    UNKNOWN = "unknown"


class QueueExtent(Enum):
    """Extent of a publisher's queue."""

    KEEP_LAST = "keep_last"
    KEEP_ALL = "keep_all"
    SYSTEM_DEFAULT = "system_default"
    UNKNOWN = "unknown"


@dataclass(frozen=True, kw_only=True)
class Qos:
    """Quality of service of a publisher, as rosbag2 stores it and ``ros2 bag play`` offers it again.

    Args:
        reliability: of delivery.
        durability: ``TRANSIENT_LOCAL`` for a latched topic.
        history: of the publisher's queue.
        depth: messages kept under ``KEEP_LAST``, at least 0.

    Raises:
        ValueError: a negative depth.
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
        """Return the profile of an ``rclpy.qos.QoSProfile`` (its policies by their names; rclpy is not imported)."""
        return cls(
            reliability=Reliability[profile.reliability.name],
            durability=Durability[profile.durability.name],
            history=QueueExtent[profile.history.name],
            depth=profile.depth,
        )

    @classmethod
    def from_rosbag2(cls, entry: Mapping[str, Any]) -> Qos:
        """Return the profile of a mapping of metadata.yaml version 9.

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
        """Return the profile as the mapping of metadata.yaml version 9."""
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
        definition: concatenated ``.msg`` text; empty: taken from the ROS installation when writing.
        type_hash: ``RIHS01_...``; empty: taken from the ROS installation when writing.
        role: purpose of the topic in the recording node, e.g. ``mesh`` or ``handles/tip/pose``, whatever its remapped
            name; empty if unknown.
    """

    name: str
    type: str
    qos: Qos = field(default_factory=Qos)
    definition: str = ""
    type_hash: str = ""
    role: str = ""
