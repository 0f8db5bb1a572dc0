# SPDX-License-Identifier: Apache-2.0
"""One MCAP file of a bag, written with mcap's own writer into reserved disk space."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path

from mcap.writer import CompressionType, Writer

import gdfe_ros
from gdfe_ros.recording.bag_info import FileCounts, bag_info, to_yaml
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.topic import TopicInfo

_STEP = 4 << 20
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
        self.path = path
        self._position = 0
        self._allocated = 0
        self._fd: int | None = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)

    def reserve(self, size: int) -> None:
        """Ensure that the next ``size`` bytes [B] can be written.

        Raises:
            OSError: there is no space (ENOSPC, EDQUOT, EFBIG, ...). Earlier reservations stay valid.
        """
        end = self._position + size
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
                os.posix_fallocate(self._descriptor(), self._allocated, end - self._allocated)
            except OSError as error:
                if error.errno not in _CANNOT_RESERVE:
                    raise
        self._allocated = end

    def write(self, data: bytes) -> int:
        """Append all bytes and return their number; raise ``OSError`` if they cannot be written."""
        view = memoryview(data)
        while view:
            count = os.write(self._descriptor(), view)
            self._position += count
            view = view[count:]
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written so far [B]."""
        return self._position

    def flush(self) -> None:
        """Do nothing: writes go straight to the operating system."""

    def sync(self) -> None:
        """Wait until the written data are on the device."""
        os.fsync(self._descriptor())

    def close(self, *, sync: bool = False) -> None:
        """Truncate the file to the written data and close it; a second call does nothing.

        Args:
            sync: whether to wait until the file is on the device.
        """
        if self._fd is None:
            return
        fd, self._fd = self._fd, None
        try:
            os.ftruncate(fd, self._position)
            if sync:
                os.fsync(fd)
        finally:
            os.close(fd)

    def _descriptor(self) -> int:
        if self._fd is None:
            raise ValueError(f"{self.path} is closed")
        return self._fd


RUN_RECORD = "gdfe_ros"
RECORDING_RECORD = "gdfe_ros_recording"
ROLE_KEY = "gdfe_ros_role"
"""Key of ``TopicInfo.role`` in a channel's metadata."""
# Upper bounds [B] of the overhead by mcap: for a message (record head, index entry), a chunk (its head and its
# index entry in the summary, by channel), a topic (schema and channel records, its part of rosbag2's
# record) and a file (header, footer, statistics, texts of our own records).
_PER_MESSAGE, _PER_CHUNK, _PER_CHUNK_CHANNEL, _PER_TOPIC, _PER_FILE = 64, 256, 48, 4096, 65536
# lz4 and zstd may lengthen incompressible data, by less than 1 / _EXPANSION of its length.
_EXPANSION = 64


class Compression(Enum):
    """Compression of chunks: ``LZ4`` is fast, ``ZSTD`` gives smaller files in twice the time, ``NONE`` suits SSDs."""

    NONE = "none"
    LZ4 = "lz4"
    ZSTD = "zstd"


class BagFile:
    """Writes one MCAP file. After a method has failed for lack of space, the file can still be finished.

    Args:
        path: path of the file, which must not exist.
        topics: topics with definition and hash filled in.
        run: origin of the run; it is written first, so that even a truncated file contains it. None: not written.
        compression: compression of the chunks.
        chunk_size: size at which a chunk is compressed and written [B].

    Raises:
        OSError: the file cannot be created, or there is no space for its beginning.
    """

    def __init__(
        self,
        path: Path,
        topics: Iterable[TopicInfo],
        *,
        run: RunInfo | None,
        compression: Compression,
        chunk_size: int,
    ) -> None:
        self.counts = FileCounts(name=path.name)
        self._storage = ReservedFile(path)
        self._writer = Writer(self._storage, chunk_size=chunk_size, compression=CompressionType[compression.name])
        self._topics: dict[str, TopicInfo] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._buffered = 0
        self._written = 0
        self._chunks = 0
        self._fixed = _PER_FILE
        try:
            self._begin(run)
            for topic in topics:
                self.add_topic(topic)
        except OSError:
            self._storage.close()
            path.unlink()
            raise

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

    @property
    def size(self) -> int:
        """Number of bytes written, plus an upper bound of the number of bytes waiting in the chunk [B]."""
        return self._written + self._buffered

    def add_topic(self, topic: TopicInfo) -> None:
        """Declare a topic; its schema and channel are written to the chunk in progress.

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

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int) -> None:
        """Append a serialised message; both times are in nanoseconds.

        Raises:
            OSError: there is no space for the message (ENOSPC, EDQUOT, EFBIG); the file without it can still be
                finished. Any other ``OSError`` means that the device failed.
        """
        size = len(data) + _PER_MESSAGE
        self._storage.reserve(self._bound(self._buffered + size))
        self._writer.add_message(
            self._channels[topic],
            log_time=log_time,
            publish_time=publish_time,
            sequence=self.counts.messages[topic],
            data=data,
        )
        self.counts.count(topic, log_time)
        self._buffered += size
        self._note_chunk()

    def _bound(self, buffered: int) -> int:
        """Return an upper bound of the bytes that `finish` writes if ``buffered`` bytes wait in the chunk [B]."""
        per_chunk = _PER_CHUNK + _PER_CHUNK_CHANNEL * len(self._channels)
        return self._fixed + (self._chunks + 1) * per_chunk + buffered + buffered // _EXPANSION

    def _note_chunk(self) -> None:
        if self._storage.tell() != self._written:
            self._written = self._storage.tell()
            self._buffered = 0
            self._chunks += 1

    def flush(self, *, sync: bool = False) -> None:
        """Write the chunk in progress; with ``sync``, also wait until it is on the device."""
        self._writer.flush()
        self._note_chunk()
        if sync:
            self._storage.sync()

    def finish(self, notes: Mapping[str, str], *, sync: bool = False) -> None:
        """Write the remaining data, the notes, rosbag2's metadata record and the index; close the file.

        Args:
            notes: status of the recording, for the metadata record ``gdfe_ros_recording``.
            sync: whether to wait until the file is on the device.

        Raises:
            OSError: the device failed; the file is closed, and its contents can be recovered.
        """
        try:
            self._writer.add_metadata(RECORDING_RECORD, dict(notes))
            info = bag_info([self.counts], self._topics.values(), custom=notes)
            self._writer.add_metadata("rosbag2", {"serialized_metadata": to_yaml(info)})
            self._writer.finish()
        finally:
            self._storage.close(sync=sync)
