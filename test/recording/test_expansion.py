# SPDX-License-Identifier: Apache-2.0
"""Compressed bags that expand too far: refused in bounded time, memory and disk; sound ones are read."""

from __future__ import annotations

import bz2
import sqlite3
import struct
import time
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard

from gdfe_ros.cli import BAD_INPUT, main
from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.decoding import LEAST, expand_bz2, expand_lz4, expand_message, expand_zstd
from gdfe_ros.recording.foreign_bag import open_bag
from gdfe_ros.recording.mcap_records import MAGIC
from gdfe_ros.recording.recovery import recover

PATIENCE = 30.0
"""Longest processor time of a refusal [s]; without limits, it was minutes."""
FAR = 4 * LEAST


def _zeros(count: int) -> bytes:
    """Return a frame of zstd with a number of zeros."""
    packer = zstandard.ZstdCompressor().compressobj(size=count)
    return b"".join(packer.compress(bytes(LEAST)) for _ in range(count // LEAST)) + packer.flush()


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def _text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def _bag(path: Path, *chunks: tuple[str, int, bytes]) -> Path:
    """Write an MCAP file with chunks: compression, declared size, and data."""
    content = _record(1, _text("ros2") + _text("test"))
    for kind, size, data in chunks:
        content += _record(6, struct.pack("<QQQI", 0, 1, size, 0) + _text(kind) + struct.pack("<Q", len(data)) + data)
    end = _record(15, struct.pack("<I", 0)) + _record(2, struct.pack("<QQI", 0, 0, 0))
    path.write_bytes(MAGIC + content + end + MAGIC)
    return path


@pytest.mark.parametrize(
    ("kind", "size", "count"), [("zstd", FAR, 1), ("zstd", 100, 1), ("zstd", LEAST, 40), ("lz4", FAR, 1), ("lz4", 9, 1)]
)
def test_chunks_that_expand_too_far_are_not_recovered(
    tmp_path: Path, kind: str, size: int, count: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """A chunk, or many chunks, of zeros end `gdfe recover` soon, also if they declare another size."""
    content = min(max(size, 2 * LEAST), FAR) if count == 1 else size
    data = _zeros(content) if kind == "zstd" else lz4.frame.compress(bytes(content))
    path, started = _bag(tmp_path / "bag.mcap", *[(kind, size, data)] * count), time.process_time()
    assert main(["recover", str(path)]) == BAD_INPUT
    assert time.process_time() - started < PATIENCE
    told = capsys.readouterr().err
    assert "expand to" in told if count > 1 else "nothing to recover" in told


def test_records_before_zeros_in_a_chunk_are_recovered(tmp_path: Path) -> None:
    """A message whose chunk ends in zeros, not even a whole number of empty records, is kept."""
    schema = struct.pack("<H", 1) + _text("std_msgs/msg/Empty") + _text("ros2msg") + _text("")
    channel = struct.pack("<HH", 1, 1) + _text("/topic") + _text("cdr") + struct.pack("<I", 0)
    message = struct.pack("<HIQQ", 1, 0, 5, 5) + bytes([0, 1, 0, 0])
    data = _record(3, schema) + _record(4, channel) + _record(5, message) + bytes(1000)
    assert recover(_bag(tmp_path / "bag.mcap", ("", len(data), data))).total == 1


@pytest.mark.parametrize(
    ("expand", "compress"),
    [
        (expand_zstd, _zeros),
        (expand_lz4, lambda count: lz4.frame.compress(bytes(count), store_size=False)[:1000]),
        (expand_bz2, lambda count: bz2.compress(bytes(count))),
        (expand_message, _zeros),
    ],
    ids=["zstd", "lz4", "bz2", "message"],
)
def test_what_expands_too_far_is_refused(expand: Callable[[bytes], bytes], compress: Callable[[int], bytes]) -> None:
    """Each kind of compression has a limit."""
    data = compress(FAR)
    with pytest.raises(ValueError, match="expands to more than the allowed"):
        expand(data)


def test_zeros_of_a_large_message_are_read() -> None:
    """A message of 50 MB of zeros is expanded, whatever its compression."""
    zeros = bytes(50_000_000)
    assert expand_zstd(zstandard.compress(zeros), len(zeros)) == zeros
    assert expand_lz4(lz4.frame.compress(zeros)) == zeros
    assert expand_bz2(bz2.compress(zeros)) == zeros


def test_a_file_that_expands_too_far_is_refused(tmp_path: Path) -> None:
    """A compressed file of zeros is refused before it fills the disk."""
    (tmp_path / "bag.db3.zstd").write_bytes(_zeros(2 * LEAST))
    with pytest.raises(RecordingError, match="expands to more than the allowed"):
        open_bag(tmp_path / "bag.db3.zstd")


def test_a_view_in_place_of_a_table_is_refused(tmp_path: Path) -> None:
    """A SQLite bag whose messages are computed without end is refused."""
    connection = sqlite3.connect(tmp_path / "bag.db3")
    connection.executescript(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format, offered_qos_profiles);"
        "CREATE VIEW messages AS WITH RECURSIVE r(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM r)"
        " SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM r;"
    )
    connection.close()
    with pytest.raises(RecordingError, match="has the view 'messages'; allowed: tables and indices"):
        open_bag(tmp_path / "bag.db3")
