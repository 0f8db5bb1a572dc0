# SPDX-License-Identifier: Apache-2.0
"""A bag in rosbag2's layout: a directory with an MCAP file, written into reserved disk space, and ``metadata.yaml``."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

import gdfe_ros
from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import (
    METADATA_FILE,
    RECORDING_RECORD,
    ROLE_KEY,
    ROOT_KEY,
    RUN_RECORD,
    FileCounts,
    TopicInfo,
    bag_info,
    to_yaml,
)
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.untrusted.regular_file import quote_path

_STEP = 4 << 20
"""Number of bytes by which a reservation grows at least, if there is space."""
_CANNOT_RESERVE = (errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)


class ReservedFile:
    """Write-only, unbuffered file; ``reserve`` allocates space before ``write`` needs it.

    A full disk, a quota or a file-size limit then causes an ``OSError`` of ``reserve``. At that moment no record is
    half written, and earlier reservations stay valid, so that the file can be finished properly. On systems or file
    systems without reservation (macOS, some network mounts), ``write`` raises such an error instead. While open, the
    file may be up to 4 MiB longer than the written data, filled with zeros; ``close`` truncates it.

    Args:
        path: path of the file, which must not exist.

    Raises:
        OSError: the file exists or cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self._file, self._allocated = path.open("xb", buffering=0), 0

    def reserve(self, size: int) -> None:
        """Ensure that the next ``size`` bytes [B] can be written.

        Raises:
            OSError: there is no space (ENOSPC, EDQUOT, EFBIG, ...). Earlier reservations stay valid.
        """
        end = self.tell() + size
        if end <= self._allocated:
            return
        generous = max(end, self._allocated + _STEP)
        try:
            self._allocate(generous)
        except OSError:
            self._allocate(end)

    def _allocate(self, end: int) -> None:
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self._file.fileno(), self._allocated, end - self._allocated)
            except OSError as error:
                if error.errno not in _CANNOT_RESERVE:
                    raise
        self._allocated = end

    def write(self, data: bytes) -> int:
        """Append all bytes and return their number; raise ``OSError`` if they cannot be written."""
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written so far [B]."""
        return self._file.tell()

    def flush(self) -> None:
        """Do nothing: writes go straight to the operating system."""

    def close(self, *, sync: bool = False) -> None:
        """Truncate the file to the written data and close it; a second call does nothing.

        Args:
            sync: whether to wait until the file is on the device.
        """
        if self._file.closed:
            return
        try:
            self._file.truncate()
            if sync:
                os.fsync(self._file.fileno())
        finally:
            self._file.close()


# Upper bounds [B] of the overhead by mcap: for a message (record head, index entry), a chunk (its head and its
# index entry in the summary, by channel), a topic (schema and channel records, its part of rosbag2's
# record) and a file (header, footer, statistics, texts of our own records).
_PER_MESSAGE, _PER_CHUNK, _PER_CHUNK_CHANNEL, _PER_TOPIC, _PER_FILE = 64, 256, 48, 4096, 65536
# lz4 and zstd may lengthen incompressible data, by less than 1 / _EXPANSION of its length.
_EXPANSION = 64
COMPRESSION = CompressionType.LZ4
"""Compression of chunks; zstd gives smaller files in twice the time."""
CHUNK = 64 << 10
"""Size at which a chunk is compressed and written [B]."""


class BagWriter:
    """Writes a bag in the calling thread; ``recorder.Recorder`` writes it in a separate thread.

    After a method has failed for lack of space, the bag can still be completed.

    Args:
        path: directory of the bag; it must not exist yet, or be empty. Parent directories are created.
        topics: topics of the bag; ``add_topic`` adds more. Missing definitions and hashes are looked up.
        run: origin of the run; it is written first, so that even a truncated file contains it. None: not written.

    Raises:
        RecordingError: the directory is in use or cannot be written, or a message type is unknown.
    """

    def __init__(self, path: str | Path, topics: Iterable[TopicInfo] = (), *, run: RunInfo | None = None) -> None:
        self.path, described = Path(path), [complete(topic) for topic in topics]
        file = self.path / f"{self.path.resolve().name}_0.mcap"
        self._counts = FileCounts(name=file.name)
        self._topics: dict[str, TopicInfo] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._buffered = self._written = self._chunks = 0
        self._fixed, self._open = _PER_FILE, True
        with _failing(f"bag {self.path} cannot be begun"):
            self.path.mkdir(parents=True, exist_ok=True)
            if any(self.path.iterdir()):
                raise RecordingError(
                    f"bag directory {self.path} exists and is not empty: name another one or remove it"
                )
            self._storage = ReservedFile(file)
            self._writer = Writer(self._storage, chunk_size=CHUNK, compression=COMPRESSION)
            try:
                self._begin(run)
                for topic in described:
                    self._declare(topic)
            except OSError:
                self._storage.close()
                file.unlink()
                raise

    def require_topic(self, name: str) -> None:
        """Raise a RecordingError if a topic was not declared."""
        if name not in self._topics:
            raise RecordingError(f"topic {name} is not in bag {self.path}; it has {sorted(self._topics)}")

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
        self._require_open()
        with _failing(f"topic {topic.name} cannot be added to bag {self.path}"):
            self._declare(complete(topic))

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
        self.require_topic(topic)
        self._require_open()
        with _failing(f"bag {self.path} takes no more messages"):
            size = len(data) + _PER_MESSAGE
            self._storage.reserve(self._bound(self._buffered + size))
            self._writer.add_message(
                self._channels[topic],
                log_time=log_time,
                publish_time=log_time if publish_time is None else publish_time,
                sequence=self._counts.messages[topic],
                data=data,
            )
            self._counts.count(topic, log_time)
            self._buffered += size
            self._note_chunk()

    def flush(self) -> None:
        """Pass every message to the operating system, so that it is not lost if this process is killed.

        Raises:
            RecordingError: the bag is closed or the device failed.
        """
        self._require_open()
        with _failing(f"bag {self.path} cannot be flushed"):
            self._writer.flush()
            self._note_chunk()

    def close(self, notes: Mapping[str, str] | None = None) -> None:
        """Complete the bag, with its index, on the device; a second call does nothing.

        Args:
            notes: status of the recording, written into the file and into metadata.yaml as ``custom_data``.

        Raises:
            RecordingError: the device failed; ``gdfe recover`` recovers the written data.
        """
        if not self._open:
            return
        self._open = False
        remedy = f". Recover the written data: gdfe recover {quote_path(self.path)}"
        with _failing(f"bag {self.path} cannot be completed", remedy):
            info = bag_info(self._counts, self._topics.values(), custom=notes)
            try:
                self._writer.add_metadata(RECORDING_RECORD, dict(notes or {}))
                self._writer.add_metadata("rosbag2", {"serialized_metadata": to_yaml(info)})
                self._writer.finish()
            finally:
                self._storage.close(sync=True)
            self._write_metadata(info)

    def _require_open(self) -> None:
        if not self._open:
            raise RecordingError(f"bag {self.path} is closed")

    def _begin(self, run: RunInfo | None) -> None:
        attachments = run.attachments() if run else {}
        metadata = run.to_metadata() if run else {}
        size = sum(len(name) + len(content) + 128 for name, content in (metadata | attachments).items())
        self._storage.reserve(size + self._fixed)
        self._writer.start(profile="ros2", library=f"gdfe_ros {gdfe_ros.__version__}")
        if run:
            self._writer.add_metadata(RUN_RECORD, metadata)
        for name, data in attachments.items():
            media = "application/yaml" if name.endswith(".yaml") else "application/octet-stream"
            self._writer.add_attachment(create_time=0, log_time=0, name=name, media_type=media, data=data)
        self._written = self._storage.tell()

    def _declare(self, topic: TopicInfo) -> None:
        """Write the schema and the channel of a topic to the chunk in progress.

        Raises:
            OSError: there is no space for the topic; the file without it can still be finished.
        """
        known = topic.type in self._schemas
        fixed = self._fixed + _PER_TOPIC + (0 if known else 2 * len(topic.definition.encode()))
        self._storage.reserve(self._bound(self._buffered) + fixed - self._fixed)
        self._fixed = fixed
        if not known:
            self._schemas[topic.type] = self._writer.register_schema(
                name=topic.type, encoding="ros2msg", data=topic.definition.encode()
            )
        self._channels[topic.name] = self._writer.register_channel(
            topic=topic.name,
            message_encoding="cdr",
            schema_id=self._schemas[topic.type],
            metadata={
                "offered_qos_profiles": to_yaml([topic.qos.to_rosbag2()]),
                "topic_type_hash": topic.type_hash,
                **({ROLE_KEY: topic.role} if topic.role else {}),
            },
        )
        self._topics[topic.name] = topic

    def _bound(self, buffered: int) -> int:
        """Return an upper bound of the bytes that ``close`` writes if ``buffered`` bytes wait in the chunk [B]."""
        per_chunk = _PER_CHUNK + _PER_CHUNK_CHANNEL * len(self._channels)
        return self._fixed + (self._chunks + 1) * per_chunk + buffered + buffered // _EXPANSION

    def _note_chunk(self) -> None:
        if self._storage.tell() != self._written:
            self._written = self._storage.tell()
            self._buffered = 0
            self._chunks += 1

    def _write_metadata(self, info: Mapping[str, Any]) -> None:
        temporary = self.path / f"{METADATA_FILE}.tmp"
        with temporary.open("w", encoding="utf-8") as file:
            file.write(to_yaml({ROOT_KEY: info}))
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(self.path / METADATA_FILE)


@contextmanager
def _failing(what: str, remedy: str = "") -> Iterator[None]:
    """Replace an error of the disk by a RecordingError that says ``what`` has failed, and the remedy."""
    try:
        yield
    except OSError as error:
        raise RecordingError(f"{what}: {error}{remedy}") from error


def complete(topic: TopicInfo) -> TopicInfo:
    """Return a topic with the definition (the ``.msg`` texts) and the hash (REP-2011) of its type in ROS 2 Jazzy.

    A definition or a hash that the topic already has is kept.

    Raises:
        RecordingError: the type is no message of ROS 2 Jazzy.
    """
    if topic.definition and topic.type_hash:
        return topic
    store = _jazzy()
    if topic.type not in store.fielddefs:
        text = f"message type {topic.type!r} of topic {topic.name} is none of ROS 2 Jazzy"
        raise RecordingError(f"{text}; allowed: package/msg/Name of its common interfaces")
    definition, _ = store.generate_msgdef(topic.type, ros_version=2)
    return replace(
        topic, definition=topic.definition or definition, type_hash=topic.type_hash or store.hash_rihs01(topic.type)
    )


@cache
def _jazzy() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)
