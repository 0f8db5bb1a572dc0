# SPDX-License-Identifier: Apache-2.0
"""Decompression of recorded data within limits, and decoding of messages to values."""

from __future__ import annotations

import bz2
import os
from collections.abc import Callable, Iterable
from types import ModuleType, SimpleNamespace
from typing import IO, Any

import lz4.frame
import mcap.stream_reader
import zstandard

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import TopicInfo

RATIO, LEAST, LARGEST = 1000, 64 << 20, 512 << 20
"""Compressed data may expand by the factor RATIO, or to LEAST bytes if that is more, but never beyond LARGEST bytes.
RATIO is so large because the strains of an undeformed large body are zeros, which expand by more than 10000. All chunks
of a file together may expand by RATIO, or to four times LEAST.
"""
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def limit_expansion(size: int, largest: int = LARGEST) -> int:
    """Return the largest number of bytes to which ``size`` compressed bytes may expand."""
    return min(max(LEAST, RATIO * size), largest)


def require_bounded(total: int, size: int) -> None:
    """Check the declared total size of the chunks of a file of ``size`` bytes.

    Raises:
        RecordingError: the chunks expand too far.
    """
    if total > (most := max(4 * LEAST, RATIO * size)):
        raise RecordingError(f"its chunks expand to {total} bytes; allowed for {size} bytes: {most}")


def expand_zstd(data: bytes, size: int = 0) -> bytes:
    """Return the content of a frame of zstd.

    Args:
        data: the frame.
        size: declared size of the content; 0 if it is not known.

    Raises:
        ValueError, zstandard.ZstdError: the frame expands too far, or is damaged.
    """
    most = min(limit_expansion(len(data)), size or LARGEST)
    if size > most or zstandard.frame_content_size(data) > most:
        raise _excess(most)
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=most)


def expand_lz4(data: bytes, size: int = 0) -> bytes:
    """Return the content of a frame of LZ4; ``size`` is not used.

    Raises:
        ValueError, RuntimeError: the frame expands too far, or is damaged.
    """
    return _expand_whole(lz4.frame.LZ4FrameDecompressor(), data)


def expand_bz2(data: bytes) -> bytes:
    """Return the content of data in bzip2's format.

    Raises:
        ValueError, OSError: the data expands too far, or is damaged.
    """
    return _expand_whole(bz2.BZ2Decompressor(), data)


def expand_message(data: bytes) -> bytes:
    """Return a ROS 2 message, decompressed if it is a frame of zstd; no uncompressed message begins like a frame.

    Raises:
        ValueError, zstandard.ZstdError: as for `expand_zstd`.
    """
    return expand_zstd(data) if data.startswith(ZSTD_MAGIC) else data


def open_zstd(file: IO[bytes], mode: str = "rb") -> Any:
    """Return a file object with the decompressed content of a file that is open for reading.

    Its ``read`` raises ValueError if more is read than the file may expand to, or than half of the free space of the
    folder for temporary files.
    """
    return _Bounded(zstandard.ZstdDecompressor().stream_reader(file), _room(os.fstat(file.fileno()).st_size))


def bound_libraries(*rosbags: ModuleType) -> None:
    """Make mcap, and the given modules of rosbags, decompress data with the limits of this module."""
    mcap.stream_reader.zstandard = SimpleNamespace(decompress=expand_zstd)
    mcap.stream_reader.lz4 = SimpleNamespace(decompress=expand_lz4)
    for module in rosbags:
        if hasattr(module, "DECOMPRESSORS"):
            module.DECOMPRESSORS.update(lz4=expand_lz4, zstd=expand_zstd)
        if hasattr(module, "decompressors"):
            module.decompressors.update(bz2=expand_bz2, lz4=expand_lz4)
        if hasattr(module, "zstd"):
            module.zstd = SimpleNamespace(open=open_zstd, decompress=expand_zstd, ZstdError=zstandard.ZstdError)


class _Bounded:
    """A file object from which at most ``most`` bytes can be read; a context manager."""

    def __init__(self, stream: Any, most: int) -> None:
        self._stream, self._most, self._left = stream, most, most

    def read(self, size: int) -> bytes:
        """Return the next bytes."""
        found = self._stream.read(size)
        self._left -= len(found)
        if self._left < 0:
            raise _excess(self._most)
        return found

    def __enter__(self) -> _Bounded:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()


def _room(size: int) -> int:
    place = os.statvfs(os.environ.get("TMPDIR", "/tmp"))
    return limit_expansion(size, largest=place.f_bavail * place.f_frsize // 2)


def _expand_whole(stream: Any, data: bytes) -> bytes:
    most = limit_expansion(len(data))
    found = stream.decompress(data, max_length=most)
    if not stream.eof:
        raise _excess(most)
    return found


def _excess(most: int) -> ValueError:
    return ValueError(f"its compressed data is cut off, or expands to more than the allowed {most} bytes")


_RULE = "=" * 80 + "\n"
"""Line before each IDL file in a definition."""
Decoder = Callable[[str, bytes], Any]


def array_decoder(topics: Iterable[TopicInfo]) -> Decoder:
    """Return a decoder for the types of these topics, made from the definitions in the bag; needs no ROS.

    Args:
        topics: topics of a bag, e.g. ``reader.topics.values()``.

    Returns:
        A function that returns a message from its type name and its CDR bytes. The message has the fields of the ROS
        message; a sequence of numbers is a numpy array, e.g. ``data`` of a PointCloud2: (n,) uint8. The function raises
        ``RecordingError`` for invalid bytes.

    Raises:
        RecordingError: a definition is damaged.

    Example:
        >>> decode = array_decoder(reader.topics.values())
        >>> clouds = [decode(m.type, m.data) for m in reader.messages(["/gdfe_sim/mesh"])]
    """
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.EMPTY)
    for topic in topics:
        try:
            types = _types_of(topic)
            store.register({name: fields for name, fields in types.items() if name not in store.fielddefs})
        except Exception as error:  # the exceptions of rosbags for invalid definitions are not documented
            raise RecordingError(
                f"topic {topic.name}: the bag's definition of {topic.type} cannot be read: {_line(error)}"
            ) from error

    def decode(type_name: str, data: bytes) -> Any:
        try:
            return store.deserialize_cdr(expand_message(data), type_name)
        except Exception as error:  # the exceptions for invalid bytes are not documented either
            raise RecordingError(
                f"{len(data)} bytes do not match the bag's definition of {type_name}: {_line(error)}"
            ) from error

    return decode


def _types_of(topic: TopicInfo) -> dict[str, Any]:
    """Return the types in a topic's definition, a text of ``.msg`` files or of IDL files."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    if not topic.definition.startswith(f"{_RULE}IDL: "):
        return get_types_from_msg(topic.definition, topic.type)
    found: dict[str, Any] = {}
    for part in topic.definition.split(_RULE)[1:]:
        found |= get_types_from_idl(part.partition("\n")[2])
    return found


def _line(error: Exception) -> str:
    """Return the text of an error of rosbags as one line of at most 200 characters."""
    return " ".join(str(error).split())[:200] if type(error).__module__.startswith("rosbags") else "it is damaged"
