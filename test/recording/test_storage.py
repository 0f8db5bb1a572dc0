# SPDX-License-Identifier: Apache-2.0
"""Reservation of disk space: a file can always be completed, whatever the disk does."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from mcap.writer import CompressionType

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording import writer as bag_writer
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.writer import BagWriter, ReservedFile


class Disk:
    """A replacement of ``os.posix_fallocate`` with a limited number of bytes."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._fallocate = os.posix_fallocate

    def __call__(self, fd: int, offset: int, length: int) -> None:
        """Allocate, or raise ENOSPC."""
        if offset + length > self.capacity:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self._fallocate(fd, offset, length)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    """Give a disk for files of at most 300 kB."""
    small = Disk(300_000)
    monkeypatch.setattr(os, "posix_fallocate", small)
    return small


def test_a_file_is_cut_to_what_was_written(tmp_path: Path) -> None:
    """A closed file has the written length, although more was reserved."""
    file = ReservedFile(tmp_path / "file")
    file.reserve(100)
    file.write(b"abc")
    assert (tmp_path / "file").stat().st_size > 3
    assert file.tell() == 3
    file.close(sync=True)
    file.close()
    assert (tmp_path / "file").read_bytes() == b"abc"
    with pytest.raises(ValueError, match="closed file"):
        file.write(b"more")


def test_a_reservation_that_fails_leaves_the_last_one(tmp_path: Path, disk: Disk) -> None:
    """After a failed reservation, the space reserved before can be used."""
    file = ReservedFile(tmp_path / "file")
    file.reserve(250_000)
    with pytest.raises(OSError, match="No space left"):
        file.reserve(350_000)
    file.write(bytes(250_000))
    file.close()
    assert (tmp_path / "file").stat().st_size == 250_000


def test_without_reservation_files_are_written_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a file system without reservation, files are written; other errors are raised."""

    def refuse(code: int) -> None:
        def fallocate(*_: int) -> None:
            raise OSError(code, os.strerror(code))

        monkeypatch.setattr(os, "posix_fallocate", fallocate)

    refuse(errno.EOPNOTSUPP)
    file = ReservedFile(tmp_path / "file")
    file.reserve(10)
    file.write(b"abc")
    refuse(errno.EIO)
    with pytest.raises(OSError, match="Input/output"):
        file.reserve(10 << 20)
    file.close()
    assert (tmp_path / "file").read_bytes() == b"abc"


def _fill(writer: BagWriter, topic: TopicInfo, accepted: list[bytes], count: int = 1000) -> None:
    """Write incompressible messages; append the accepted ones to ``accepted``."""
    for _ in range(count):
        message = os.urandom(1500)
        writer.write(topic.name, message, len(accepted))
        accepted.append(message)


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_a_bag_on_a_full_disk_can_be_closed(
    tmp_path: Path, disk: Disk, mesh_topic: TopicInfo, compression: CompressionType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a full disk, every accepted message is in the closed bag."""
    monkeypatch.setattr(bag_writer, "COMPRESSION", compression)
    monkeypatch.setattr(bag_writer, "CHUNK", 1024)
    writer = BagWriter(tmp_path / "bag", [mesh_topic])
    accepted: list[bytes] = []
    with pytest.raises(RecordingError, match="No space left"):
        _fill(writer, mesh_topic, accepted)
    disk.capacity = 0
    writer.close()
    assert len(accepted) > 80
    assert [m.data for m in BagReader(tmp_path / "bag").messages()] == accepted


def test_a_bag_without_room_for_its_beginning_is_refused(tmp_path: Path, disk: Disk, mesh_topic: TopicInfo) -> None:
    """A bag on a full disk is refused with a clear error, and no file is left."""
    disk.capacity = 0
    with pytest.raises(RecordingError, match=r"cannot be begun.*No space left"):
        BagWriter(tmp_path / "bag", [mesh_topic])
    assert not list((tmp_path / "bag").iterdir())
