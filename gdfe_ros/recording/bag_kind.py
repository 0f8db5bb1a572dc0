# SPDX-License-Identifier: Apache-2.0
"""Kinds of bags, which the first bytes of their files show."""

from __future__ import annotations

from enum import Enum
from pathlib import Path

import yaml

from gdfe_ros.bounded_text import load_yaml
from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import METADATA_FILE, ROOT_KEY
from gdfe_ros.regular_file import read_text

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
