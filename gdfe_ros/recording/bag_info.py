# SPDX-License-Identifier: Apache-2.0
"""rosbag2's description of a bag (``metadata.yaml``, version 9), made from the counts of the bag's files."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from gdfe_ros.recording.topic import TopicInfo

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
