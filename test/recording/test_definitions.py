# SPDX-License-Identifier: Apache-2.0
"""Message definitions and hashes agree with those of the ROS installation."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import pytest
from rosbags.typesys import get_types_from_msg

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.writer import complete

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


def _share(name: str, suffix: str) -> Path:
    """Return the file of a type in the ROS installation."""
    package, kind, name = name.split("/")
    prefixes = Path(import_module(f"{package}.{kind}").__file__).resolve().parents
    paths = (prefix / "share" / package / kind / f"{name}{suffix}" for prefix in prefixes)
    return next(path for path in paths if path.is_file())


@pytest.mark.parametrize("name", TYPES)
def test_hash_is_that_of_ros(name: str) -> None:
    """The type hash equals the one of the installed package."""
    hashes = json.loads(_share(name, ".json").read_text())["type_hashes"]
    known = {entry["type_name"]: entry["hash_string"] for entry in hashes}
    assert complete(TopicInfo(name="/topic", type=name)).type_hash == known[name]


@pytest.mark.parametrize("name", TYPES)
def test_definition_parses_to_the_fields_of_ros(name: str) -> None:
    """The definition has the fields of the installed .msg file."""
    parsed = get_types_from_msg(complete(TopicInfo(name="/topic", type=name)).definition, name)
    assert parsed[name][1] == get_types_from_msg(_share(name, ".msg").read_text(), name)[name][1]


def test_definition_begins_with_the_type_itself_and_has_its_parts() -> None:
    """A definition starts with the type itself, followed by each part once, as in rosbag2."""
    text = complete(TopicInfo(name="/topic", type="geometry_msgs/msg/PoseStamped")).definition
    heads = [line.removeprefix("MSG: ") for line in text.splitlines() if line.startswith("MSG: ")]
    assert sorted(heads) == [
        "builtin_interfaces/Time",
        "geometry_msgs/Point",
        "geometry_msgs/Pose",
        "geometry_msgs/Quaternion",
        "std_msgs/Header",
    ]
    assert text.index("pose") < text.index("=" * 80)


def test_what_a_topic_has_stays() -> None:
    """A topic of another recorder, with definition and hash, is taken as it is."""
    topic = TopicInfo(name="/topic", type="nowhere_msgs/msg/Thing", definition="int32 x", type_hash="RIHS01_0")
    assert complete(topic) is topic


@pytest.mark.parametrize("name", ["PointCloud2", "sensor_msgs/PointCloud2", "nowhere_msgs/msg/Thing"])
def test_unknown_types_are_refused(name: str) -> None:
    """An unknown type is refused with its name."""
    with pytest.raises(RecordingError, match=f"{name}.* of topic /topic is none of ROS 2 Jazzy"):
        complete(TopicInfo(name="/topic", type=name))
