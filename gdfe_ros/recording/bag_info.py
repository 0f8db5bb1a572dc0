# SPDX-License-Identifier: Apache-2.0
"""rosbag2's description of a bag (``metadata.yaml``, version 9), made from the counts of the bag's files."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import yaml

from gdfe_ros.bounded_text import load_yaml
from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.topic import TopicInfo
from gdfe_ros.regular_file import read_text

METADATA_FILE = "metadata.yaml"
ROOT_KEY = "rosbag2_bagfile_information"
IN_RUN = "bag"
"""Name of the bag's folder in the folder of a run; the run's folder also contains a picture."""


def bag_directory(path: Path) -> Path:
    """Return the directory of a bag: if ``path`` is the folder of a run, the bag's folder in it; else ``path``."""
    return path / IN_RUN if path.is_dir() and not _has_bag(path) and _has_bag(path / IN_RUN) else path


def _has_bag(path: Path) -> bool:
    return (path / METADATA_FILE).is_file() or any(path.glob("*.mcap"))


@dataclass(kw_only=True)
class FileCounts:
    """Counts of one file of a bag, updated with each message.

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

    @property
    def total(self) -> int:
        """Number of messages in the file."""
        return self.messages.total()

    def count(self, topic: str, log_time: int) -> None:
        """Count one message of a topic with a log time [ns]."""
        first = not self.messages
        self.start = log_time if first else min(self.start, log_time)
        self.end = max(self.end, log_time)
        self.messages[topic] += 1

    def to_rosbag2(self) -> dict[str, Any]:
        """Return the file's entry in rosbag2's list ``files``."""
        return {
            "path": self.name,
            "starting_time": {"nanoseconds_since_epoch": self.start},
            "duration": {"nanoseconds": self.end - self.start},
            "message_count": self.total,
        }


def bag_info(
    files: Sequence[FileCounts], topics: Iterable[TopicInfo], *, custom: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return rosbag2's description of a bag of these files.

    Args:
        files: counts of the files, in the order in which the files were written.
        topics: topics of the bag, with type hashes filled in.
        custom: texts that rosbag2 stores as ``custom_data``.

    Returns:
        The value of the key ``rosbag2_bagfile_information``.
    """
    filled = [file for file in files if file.total]
    start = min((file.start for file in filled), default=0)
    end = max((file.end for file in filled), default=0)
    counts = sum((file.messages for file in files), Counter())
    return {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": counts.total(),
        "topics_with_message_count": [
            {"topic_metadata": _topic_entry(topic), "message_count": counts[topic.name]} for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [file.to_rosbag2() for file in files],
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
    """Return the files of a bag's directory in their order, without its metadata; a file is its own bag."""
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
    """Raise an error that names the kind of a file that is no MCAP file, also no damaged one.

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
