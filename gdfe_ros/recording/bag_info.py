# SPDX-License-Identifier: Apache-2.0
"""rosbag2's description of a bag (``metadata.yaml``, version 9): its topics, its files and their counts."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from enum import Enum
from pathlib import Path
from typing import Any

import yaml

from gdfe_ros.errors import RecordingError
from gdfe_ros.untrusted.bounded_text import load_yaml
from gdfe_ros.untrusted.regular_file import path_inside, read_text

METADATA_FILE = "metadata.yaml"
ROOT_KEY = "rosbag2_bagfile_information"
RUN_RECORD, RECORDING_RECORD = "gdfe_ros", "gdfe_ros_recording"
"""Names of our metadata records in an MCAP file: the origin of the run, and the status of the recording."""
ROLE_KEY = "gdfe_ros_role"
"""Key of ``TopicInfo.role`` in a channel's metadata."""
IN_RUN = "bag"
"""Name of the bag's folder in the folder of a run; the run's folder also contains a picture."""


def bag_directory(path: Path) -> Path:
    """Return the directory of a bag: if ``path`` is the folder of a run, the bag's folder in it; else ``path``."""
    return path / IN_RUN if path.is_dir() and not _has_bag(path) and _has_bag(path / IN_RUN) else path


def _has_bag(path: Path) -> bool:
    return (path / METADATA_FILE).is_file() or any(path.glob("*.mcap"))


def make_run_folder(scene: str) -> Path:
    """Create an empty folder for a run of a scene, ``runs/<scene>_<time>``, and return its path.

    Each call creates another folder, also if several processes call at the same time.

    Raises:
        RecordingError: the folder cannot be created.
    """
    runs = Path("runs")
    try:
        runs.mkdir(exist_ok=True)
        while True:
            with suppress(FileExistsError):  # at the next time, the name is another one
                folder = path_inside(runs, f"{scene}_{datetime.now():%Y%m%d_%H%M%S_%f}")
                folder.mkdir()
                return folder
    except OSError as error:
        text = f"no folder for the run can be created in {runs.absolute()}: {error.strerror}"
        raise RecordingError(f"{text}; remedy: name another place for it") from error


# rosbag2 writes "no deadline" as the largest rmw_time_t.
_INFINITE = {"sec": 9223372036, "nsec": 854775807}
_POLICIES = {
    "reliability": ("reliable", "best_effort", "system_default", "best_available", "unknown"),
    "durability": ("volatile", "transient_local", "system_default", "best_available", "unknown"),
    "history": ("keep_last", "keep_all", "system_default", "unknown"),
}
"""Names of the policies, as ROS 2 writes them since Jazzy."""


@dataclass(frozen=True, kw_only=True)
class Qos:
    """Quality of service of a publisher; rosbag2 stores it, and ``ros2 bag play`` offers it again.

    Args:
        reliability: whether lost messages are resent: ``reliable``, ``best_effort``, ...
        durability: ``transient_local`` if late subscribers receive the last messages (latched topic), else
            ``volatile``, ...
        history: whether the publisher's queue contains the last messages (``keep_last``) or all (``keep_all``).
        depth: number of messages in the queue under ``keep_last``, at least 0.

    Raises:
        ValueError: the depth is negative, or a policy has another name.
    """

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = 10

    def __post_init__(self) -> None:
        if self.depth < 0:
            raise ValueError(f"qos depth is {self.depth}; allowed: 0 or more")
        for name, known in _POLICIES.items():
            if getattr(self, name) not in known:
                raise ValueError(f"{name} is {getattr(self, name)!r}; allowed: {', '.join(known)}")

    @classmethod
    def from_rclpy(cls, profile: Any) -> Qos:
        """Return the profile of an ``rclpy.qos.QoSProfile``, by the names of its policies; rclpy is not imported."""
        return cls(**{name: getattr(profile, name).name.lower() for name in _POLICIES}, depth=profile.depth)

    @classmethod
    def from_rosbag2(cls, entry: Mapping[str, Any]) -> Qos:
        """Return the profile from a mapping in the form of metadata.yaml, version 9.

        Raises:
            RecordingError: a policy is not one of the names that ROS 2 has written since Jazzy.
        """
        try:
            return cls(**{name: entry[name] for name in (*_POLICIES, "depth")})
        except (KeyError, ValueError) as error:
            raise RecordingError(
                f"quality of service {dict(entry)} is not as ROS 2 writes it since Jazzy: {error!r}"
            ) from error

    def to_rosbag2(self) -> dict[str, Any]:
        """Return the profile as a mapping in the form of metadata.yaml, version 9."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
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
        definition: concatenated ``.msg`` texts; if empty, the writer takes the definition of ROS 2 Jazzy.
        type_hash: hash ``RIHS01_...`` of the type; if empty, the writer takes the hash of ROS 2 Jazzy.
        role: name of the topic relative to the recording node, without remapping, e.g. ``mesh`` or
            ``handles/tip/pose``; empty if unknown.
    """

    name: str
    type: str
    qos: Qos = field(default_factory=Qos)
    definition: str = ""
    type_hash: str = ""
    role: str = ""


@dataclass(kw_only=True)
class FileCounts:
    """Counts of a bag's file, updated with each message.

    Args:
        name: file name inside the bag directory.
        start: smallest log time [ns]; 0 while there is no message.
        end: largest log time [ns].
        messages: number of messages by topic.
    """

    name: str
    start: int = 0
    end: int = 0
    messages: Counter[str] = field(default_factory=Counter)

    def count(self, topic: str, log_time: int) -> None:
        """Count one message of a topic with a log time [ns]."""
        first = not self.messages
        self.start = log_time if first else min(self.start, log_time)
        self.end = max(self.end, log_time)
        self.messages[topic] += 1


def bag_info(
    file: FileCounts, topics: Iterable[TopicInfo], *, custom: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return rosbag2's description of a bag of one file.

    Args:
        file: counts of the file.
        topics: topics of the bag, with type hashes filled in.
        custom: texts that rosbag2 stores as ``custom_data``.

    Returns:
        The value of the key ``rosbag2_bagfile_information``.
    """
    facts = {
        "starting_time": {"nanoseconds_since_epoch": file.start},
        "duration": {"nanoseconds": file.end - file.start},
        "message_count": file.messages.total(),
    }
    return {
        "version": 9,
        "storage_identifier": "mcap",
        **facts,
        "topics_with_message_count": [
            {"topic_metadata": _topic_entry(topic), "message_count": file.messages[topic.name]} for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name],
        "files": [{"path": file.name, **facts}],
        "custom_data": dict(custom) if custom else None,
        "ros_distro": os.environ.get("ROS_DISTRO", "jazzy"),
    }


def to_yaml(data: Any) -> str:
    """Return plain data as YAML text in block style, with keys in the given order."""
    return yaml.safe_dump(data, sort_keys=False, default_flow_style=False)


def _topic_entry(topic: TopicInfo) -> dict[str, Any]:
    return {
        "name": topic.name,
        "type": topic.type,
        "serialization_format": "cdr",
        "offered_qos_profiles": [topic.qos.to_rosbag2()],
        "type_description_hash": topic.type_hash,
    }


LARGEST_METADATA = 4_000_000
"""Largest size of metadata.yaml [bytes]."""
_HEAD = 16


class BagKind(Enum):
    """Kind of a bag's file; the value is its name in messages."""

    MCAP = "MCAP"
    SQLITE = "SQLite (rosbag2)"
    ROS1 = "ROS 1"
    ZSTD = "compressed with zstd"
    OTHER = "of an unknown kind"
    EMPTY = "empty"


_DAMAGED = (BagKind.OTHER, ".mcap")
"""Kind and suffix of an MCAP file whose first bytes are damaged."""
_STARTS = {
    b"\x89MCAP": BagKind.MCAP,
    b"SQLite format 3\0": BagKind.SQLITE,
    b"#ROSBAG V2": BagKind.ROS1,
    b"\x28\xb5\x2f\xfd": BagKind.ZSTD,
}


def file_kind(path: Path) -> BagKind:
    """Return the kind of a file.

    Raises:
        RecordingError: the file cannot be read.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEAD)
    except OSError as error:
        raise RecordingError(f"bag file {path} cannot be read: {error}") from error
    if not head.strip(b"\0"):
        return BagKind.EMPTY
    return next((kind for start, kind in _STARTS.items() if head.startswith(start)), BagKind.OTHER)


def storage_files(path: Path) -> list[Path]:
    """Return the files of a bag's directory in their order, without its metadata; for a file, the file itself."""
    if path.is_file():
        return [path]
    known = (".mcap", ".db3", ".bag", ".zstd")
    return sorted(file for file in path.glob("*") if file.suffix in known and file.is_file())


def is_plain_mcap(path: Path) -> bool:
    """Return whether a bag's files are MCAP, and neither the files nor their messages are compressed by rosbag2."""
    files = storage_files(path)
    kinds = [(file_kind(file), file.suffix) for file in files]
    if not all(kind in (BagKind.MCAP, BagKind.EMPTY) or (kind, suffix) == _DAMAGED for kind, suffix in kinds):
        return False
    return not files or not _compression(path / METADATA_FILE)


def require_mcap(file: Path) -> None:
    """Raise an error that names the file's kind, unless the file is MCAP, possibly damaged.

    Raises:
        RecordingError: the file is no MCAP file.
    """
    kind = file_kind(file)
    if kind in (BagKind.SQLITE, BagKind.ROS1, BagKind.ZSTD):
        remedy = "remedy: `gdfe fit` reads it; other commands need a bag that gdfe recorded, in MCAP"
        raise RecordingError(f"bag file {file} is {kind.value}; {remedy}")
    if kind is BagKind.OTHER and file.suffix != ".mcap":
        raise RecordingError(f"bag file {file} is {kind.value}; remedy: an MCAP file, a .db3 or a .bag")


def _compression(metadata: Path) -> str:
    """Return rosbag2's compression mode of a bag, in small letters; an empty text if there is none."""
    if not metadata.is_file():
        return ""
    try:
        info = load_yaml(read_text(metadata, most=LARGEST_METADATA))[ROOT_KEY]
        mode = str(info.get("compression_mode") or "").lower()
    except (OSError, UnicodeDecodeError, yaml.YAMLError, TypeError, KeyError, AttributeError):
        return ""  # the reader of MCAP bags says what is wrong with this file
    return "" if mode == "none" else mode
