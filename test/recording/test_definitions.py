# SPDX-License-Identifier: Apache-2.0
"""Message definitions and hashes agree with those that rosbags has."""

from __future__ import annotations

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.writer import message_definition, type_hash

TYPES = [
    "sensor_msgs/msg/PointCloud2",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/WrenchStamped",
    "std_msgs/msg/Int32MultiArray",
    "std_msgs/msg/Float64MultiArray",
    "diagnostic_msgs/msg/DiagnosticArray",
    "visualization_msgs/msg/Marker",
    "trajectory_msgs/msg/JointTrajectory",
    "rosgraph_msgs/msg/Clock",
]


@pytest.mark.parametrize("name", TYPES)
def test_hash_is_that_of_rosbags(name: str) -> None:
    """The type hash equals the one that rosbags computes from its own definitions."""
    assert type_hash(name) == get_typestore(Stores.ROS2_JAZZY).hash_rihs01(name)


@pytest.mark.parametrize("name", TYPES)
def test_definition_parses_to_the_same_fields(name: str) -> None:
    """The library rosbags parses our definition to the same type and parts, field by field."""
    store = get_typestore(Stores.ROS2_JAZZY)
    parsed = get_types_from_msg(message_definition(name), name)
    assert name in parsed
    for part, fields in parsed.items():
        assert fields[1] == store.fielddefs[part][1]


def test_definition_begins_with_the_type_itself_and_sorts_its_parts() -> None:
    """A definition starts with the type itself, followed by each part once, by name, as in rosbag2."""
    text = message_definition("geometry_msgs/msg/PoseStamped")
    heads = [line.removeprefix("MSG: ") for line in text.splitlines() if line.startswith("MSG: ")]
    assert heads == [
        "builtin_interfaces/Time",
        "geometry_msgs/Point",
        "geometry_msgs/Pose",
        "geometry_msgs/Quaternion",
        "std_msgs/Header",
    ]
    assert text.index("Pose pose") < text.index("=" * 80)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("PointCloud2", "not of the form"),
        ("sensor_msgs/PointCloud2", "not of the form"),
        ("nowhere_msgs/msg/Thing", "not importable.*setup.bash"),
        ("sensor_msgs/msg/Nothing", "has no share/sensor_msgs/msg/Nothing.msg"),
        ("json/msg/Thing", "has no share/json"),
    ],
)
def test_unknown_types_are_refused_with_a_remedy(name: str, message: str) -> None:
    """An unknown type is refused with its name and what is missing."""
    with pytest.raises(RecordingError, match=message):
        message_definition(name)
