# SPDX-License-Identifier: Apache-2.0
"""Bounded expansion of compressed bags: 92 kB of zstd can be 3 GB of zeros, which fill a memory or a disk.

mcap and rosbags expand chunks, messages and files without a limit. `bound_libraries` gives their modules the functions
of this module in place of those of zstandard, lz4 and bz2.
"""

from __future__ import annotations

import bz2
import os
from types import ModuleType, SimpleNamespace
from typing import IO, Any

import lz4.frame
import mcap.stream_reader
import zstandard

from gdfe_ros.errors import RecordingError

RATIO, LEAST, LARGEST = 1000, 64 << 20, 512 << 20
"""Data may expand by the first factor, or to the second number of bytes if that is more, but not beyond the third. The
strains of an undeformed large body are a message of zeros, which expands by more than 10000. The chunks of a file
together may expand by the first factor, or to four times the second number.
"""
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def allowed(size: int, largest: int = LARGEST) -> int:
    """Return the largest number of bytes to which ``size`` compressed bytes may expand."""
    return min(max(LEAST, RATIO * size), largest)


def require_bounded(total: int, size: int) -> None:
    """Check the declared total size of the chunks of a file of ``size`` bytes.

    Raises:
        RecordingError: they expand too far.
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
    most = min(allowed(len(data)), size or LARGEST)
    if size > most or zstandard.frame_content_size(data) > most:
        raise _excess(most)
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=most)


def expand_lz4(data: bytes, size: int = 0) -> bytes:
    """Return the content of a frame of LZ4; ``size`` is not used.

    Raises:
        ValueError, RuntimeError: the frame expands too far, or is damaged.
    """
    return _ended(lz4.frame.LZ4FrameDecompressor(), data)


def expand_bz2(data: bytes) -> bytes:
    """Return the content of bzip2's data.

    Raises:
        ValueError, OSError: the data expands too far, or is damaged.
    """
    return _ended(bz2.BZ2Decompressor(), data)


def expand_message(data: bytes) -> bytes:
    """Return a message of ROS 2 that a recorder has compressed; any other as it is. None begins as zstd's frames do.

    Raises:
        ValueError, zstandard.ZstdError: as for `expand_zstd`.
    """
    return expand_zstd(data) if data.startswith(ZSTD_MAGIC) else data


def open_zstd(file: IO[bytes], mode: str = "rb") -> Any:
    """Return a stream of the content of a file, which is open for reading.

    Its ``read`` raises ValueError if more is read than the file may expand to, or than half of the free space of the
    folder for temporary files.
    """
    return _Bounded(zstandard.ZstdDecompressor().stream_reader(file), _room(os.fstat(file.fileno()).st_size))


def bound_libraries(*rosbags: ModuleType) -> None:
    """Replace the expansion in the modules of mcap, and in those of rosbags that are given."""
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
    """A stream of which at most ``most`` bytes can be read; a context manager."""

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
    return allowed(size, largest=place.f_bavail * place.f_frsize // 2)


def _ended(stream: Any, data: bytes) -> bytes:
    most = allowed(len(data))
    found = stream.decompress(data, max_length=most)
    if not stream.eof:
        raise _excess(most)
    return found


def _excess(most: int) -> ValueError:
    return ValueError(f"its compressed data is cut off, or expands to more than the allowed {most} bytes")
