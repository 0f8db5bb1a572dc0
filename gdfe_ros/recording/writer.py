# SPDX-License-Identifier: Apache-2.0
"""A bag in rosbag2's layout: a directory with MCAP files, split by size or time, and ``metadata.yaml``."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_file import BagFile, Compression
from gdfe_ros.recording.bag_info import METADATA_FILE, ROOT_KEY, FileCounts, bag_info, to_yaml
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.topic import TopicInfo

_PRIMITIVES = frozenset(
    {"bool", "byte", "char", "string", "wstring", "float32", "float64"}
    | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
)
_TYPE_NAME = re.compile(r"^[A-Za-z]\w*/msg/[A-Za-z]\w*$")
_SEPARATOR = "=" * 80


@cache
def message_definition(type_name: str) -> str:
    """Return the concatenated ``.msg`` texts of a type and of every type it contains (encoding ``ros2msg``).

    Args:
        type_name: name of the type, e.g. ``sensor_msgs/msg/PointCloud2``.

    Returns:
        The text of the type, then the texts of the types that it contains, sorted by name. A line of 80 ``=`` and a
        line ``MSG: pkg/Name`` precede the text of each contained type.

    Raises:
        RecordingError: the name is not that of a message type, or the type's package is not installed.
    """
    texts: dict[str, str] = {}
    pending = [type_name]
    while pending:
        name = pending.pop()
        if name not in texts:
            texts[name] = _share_file(name, ".msg").read_text(encoding="utf-8")
            pending += _parts(name, texts[name])
    root = texts.pop(type_name)
    return root + "".join(f"\n{_SEPARATOR}\nMSG: {name.replace('/msg/', '/')}\n{texts[name]}" for name in sorted(texts))


@cache
def type_hash(type_name: str) -> str:
    """Return the type hash ``RIHS01_<sha256>`` (REP-2011) of a message type.

    Raises:
        RecordingError: the name is not that of a message type, its package is not installed, or the type has no hash.
    """
    path = _share_file(type_name, ".json")
    for entry in json.loads(path.read_text(encoding="utf-8"))["type_hashes"]:
        if entry["type_name"] == type_name:
            return entry["hash_string"]
    raise RecordingError(f"{path} holds no type hash of {type_name}: reinstall the message package")


def _share_file(type_name: str, suffix: str) -> Path:
    if not _TYPE_NAME.match(type_name):
        raise RecordingError(f"message type {type_name!r} is not of the form package/msg/Name")
    package, _, name = type_name.split("/")
    spec = find_spec(package)
    # A namespace package has no origin but search locations; both lie below the installation's prefix.
    places = [*(spec.submodule_search_locations or [])] if spec else []
    for place in places:
        for prefix in Path(place).resolve().parents:
            path = prefix / "share" / package / "msg" / f"{name}{suffix}"
            if path.is_file():
                return path
    reason = f"has no share/{package}/msg/{name}{suffix}" if places else "is not importable"
    raise RecordingError(
        f"message type {type_name}: the ROS package {package} {reason}. Source a ROS 2 Jazzy setup.bash, or "
        "install the ROS wheels: pip install 'gdfe_ros[ros]'."
    )


def _parts(type_name: str, text: str) -> list[str]:
    """Return the names of the message types of the fields in a definition; ``text`` is the ``.msg`` text."""
    package = type_name.split("/")[0]
    found = []
    for line in text.splitlines():
        words = line.split("#", 1)[0].split()
        base = re.sub(r"(\[.*\]|<=.*)", "", words[0]) if words else ""
        if base and base not in _PRIMITIVES:
            owner, _, name = base.rpartition("/")
            found.append(f"{owner.split('/')[0] or package}/msg/{name}")
    return found


class FsyncPolicy(Enum):
    """When to wait until data are on the device. If the process is killed, no written data are lost.

    After a power failure, data that are not yet on the device may be lost.
    """

    NEVER = "never"
    CLOSE = "close"
    FLUSH = "flush"


@dataclass(frozen=True, kw_only=True)
class BagOptions:
    """Options for writing a bag.

    Args:
        compression: compression of the chunks.
        chunk_size: size at which a chunk is compressed and written [B], 1 KiB to 64 MiB.
        split_bytes: approximate size at which a new file is begun [B], 64 KiB or more; None: never.
        split_seconds: range of log times in a file at which a new file is begun [s], above 0; None: never.
        fsync: when to wait until data are on the device.

    Raises:
        ValueError: a value is out of range.
    """

    compression: Compression = Compression.LZ4
    chunk_size: int = 64 << 10
    split_bytes: int | None = None
    split_seconds: float | None = None
    fsync: FsyncPolicy = FsyncPolicy.CLOSE

    def __post_init__(self) -> None:
        if not 1 << 10 <= self.chunk_size <= 64 << 20:
            raise ValueError(f"chunk_size is {self.chunk_size} B; allowed: 1024 to {64 << 20}")
        if self.split_bytes is not None and self.split_bytes < 64 << 10:
            raise ValueError(f"split_bytes is {self.split_bytes} B; allowed: {64 << 10} or more, or None")
        if self.split_seconds is not None and not self.split_seconds > 0:
            raise ValueError(f"split_seconds is {self.split_seconds} s; allowed: above 0, or None")


class BagWriter:
    """Writes a bag in the calling thread; ``recorder.Recorder`` writes it in a separate thread.

    Args:
        path: directory of the bag; it must not exist yet, or be empty. Parent directories are created.
        topics: topics of the bag; ``add_topic`` adds more. Missing definitions and hashes are looked up.
        run: origin of the run, embedded in every file; None: nothing is embedded.
        options: compression, splitting, fsync.

    Raises:
        RecordingError: the directory is in use or cannot be written, or a message type is unknown.
    """

    def __init__(
        self,
        path: str | Path,
        topics: Iterable[TopicInfo] = (),
        *,
        run: RunInfo | None = None,
        options: BagOptions | None = None,
    ) -> None:
        self.path = Path(path)
        self._options = options or BagOptions()
        self._run = run
        self._topics = {topic.name: _complete(topic) for topic in topics}
        self._done: list[FileCounts] = []
        self._file: BagFile | None = None
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            if any(self.path.iterdir()):
                raise RecordingError(
                    f"bag directory {self.path} exists and is not empty: name another one or remove it"
                )
            self._file = self._open_file(0)
        except OSError as error:
            raise RecordingError(f"bag {self.path} cannot be begun: {error}") from error

    @property
    def topics(self) -> dict[str, TopicInfo]:
        """Topics of the bag by name, with definition and hash filled in."""
        return dict(self._topics)

    @property
    def size(self) -> int:
        """Size of the file in progress [B]; data that wait in the chunk are counted uncompressed."""
        return self._file.size if self._file else 0

    def add_topic(self, topic: TopicInfo) -> None:
        """Declare a further topic; to declare the same topic again has no effect.

        Raises:
            RecordingError: the name is in use for another type, the type is unknown, the bag is closed, or
                there is no space.
        """
        known = self._topics.get(topic.name)
        if known is not None:
            if known.type != topic.type:
                raise RecordingError(f"topic {topic.name} is of type {known.type}, not {topic.type}")
            return
        complete = _complete(topic)
        try:
            self._open_part().add_topic(complete)
        except OSError as error:
            raise RecordingError(f"topic {topic.name} cannot be added to bag {self.path}: {error}") from error
        self._topics[topic.name] = complete

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int | None = None) -> None:
        """Append one message.

        Args:
            topic: name of a declared topic.
            data: serialised message (CDR with its 4-byte head).
            log_time: time since the epoch or since the start of the simulation [ns].
            publish_time: time of the publisher's stamp [ns]; None: ``log_time``.

        Raises:
            RecordingError: the topic is unknown, the bag is closed, there is no space, or the device failed. If there
                is no space, the bag stays intact without this message, and ``close`` can complete it.
        """
        if topic not in self._topics:
            raise RecordingError(f"topic {topic} is not in bag {self.path}; it has {sorted(self._topics)}")
        try:
            part = self._open_part()
            if self._is_full(part, log_time):
                part = self._next_part()
            part.write(topic, data, log_time, log_time if publish_time is None else publish_time)
        except OSError as error:
            raise RecordingError(f"bag {self.path} takes no more messages: {error}") from error

    def flush(self) -> None:
        """Pass every message to the operating system, so that it is not lost if this process is killed.

        Raises:
            RecordingError: the bag is closed or the device failed.
        """
        try:
            self._open_part().flush(sync=self._options.fsync is FsyncPolicy.FLUSH)
        except OSError as error:
            raise RecordingError(f"bag {self.path} cannot be flushed: {error}") from error

    def close(self, notes: Mapping[str, str] | None = None) -> None:
        """Complete the bag; a second call does nothing.

        Args:
            notes: status of the recording, written into the last file and into metadata.yaml as ``custom_data``.

        Raises:
            RecordingError: the device failed; ``gdfe recover`` recovers the written data.
        """
        if self._file is None:
            return
        try:
            self._finish_part(notes or {})
            self._write_metadata(notes or {})
        except OSError as error:
            raise RecordingError(
                f"bag {self.path} cannot be completed: {error}. Recover the written data: gdfe recover {self.path}"
            ) from error

    def _open_part(self) -> BagFile:
        if self._file is None:
            raise RecordingError(f"bag {self.path} is closed")
        return self._file

    def _open_file(self, index: int) -> BagFile:
        return BagFile(
            self.path / f"{self.path.resolve().name}_{index}.mcap",
            self._topics.values(),
            run=self._run,
            compression=self._options.compression,
            chunk_size=self._options.chunk_size,
        )

    def _is_full(self, part: BagFile, log_time: int) -> bool:
        if not part.counts.total:
            return False
        size, seconds = self._options.split_bytes, self._options.split_seconds
        by_size = size is not None and part.size >= size
        return by_size or (seconds is not None and log_time - part.counts.start >= seconds * 1e9)

    def _next_part(self) -> BagFile:
        # Open the new file before the last file is finished: without space for it, the last file can be completed.
        following = self._open_file(len(self._done) + 1)
        self._finish_part({})
        self._file = following
        return following

    def _finish_part(self, notes: Mapping[str, str]) -> None:
        part = self._open_part()
        self._file = None
        self._done.append(part.counts)
        part.finish(notes, sync=self._options.fsync is not FsyncPolicy.NEVER)

    def _write_metadata(self, notes: Mapping[str, str]) -> None:
        text = to_yaml({ROOT_KEY: bag_info(self._done, self._topics.values(), custom=notes)})
        temporary = self.path / f"{METADATA_FILE}.tmp"
        with temporary.open("w", encoding="utf-8") as file:
            file.write(text)
            if self._options.fsync is not FsyncPolicy.NEVER:
                file.flush()
                os.fsync(file.fileno())
        temporary.replace(self.path / METADATA_FILE)


def _complete(topic: TopicInfo) -> TopicInfo:
    """Return a topic; take a missing definition or hash from the ROS installation."""
    return replace(
        topic,
        definition=topic.definition or message_definition(topic.type),
        type_hash=topic.type_hash or type_hash(topic.type),
    )
