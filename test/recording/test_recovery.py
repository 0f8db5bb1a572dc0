# SPDX-License-Identifier: Apache-2.0
"""Bags that were cut off are recovered except for the last moments."""

from __future__ import annotations

import random
import struct
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import CompressionType
from rosbags.rosbag2 import Reader

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording import writer as bag_writer
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.recorder import FLUSH_INTERVAL
from gdfe_ros.recording.recovery import recover
from gdfe_ros.recording.writer import BagWriter

SCENE = "name: bar\n"

# Records 44 kB messages at 100 Hz; how many were recorded, and how many of them were in transit to the disk when the
# last flush began that is over, is put into a file that survives the kill.
CHILD = """
import mmap, struct, sys, time
import numpy as np
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.writer import BagWriter

path, tally = sys.argv[1:]
mesh = TopicInfo(name="/mesh", type="sensor_msgs/msg/PointCloud2")
body = np.random.default_rng(4).normal(size=(1836, 6)).astype("<f4").tobytes()
flush = BagWriter.flush
with open(tally, "r+b") as file, mmap.mmap(file.fileno(), 16) as count:
    def flush_and_tell(writer):
        written = recorder.status.written
        flush(writer)
        count[8:] = struct.pack("<Q", written)

    BagWriter.flush = flush_and_tell
    recorder = Recorder(path, [mesh], run=RunInfo(scene="name: bar\\n"))
    for step in range(10000):
        recorder.record(mesh.name, struct.pack("<Q", step) + body, step * 10_000_000)
        count[:8] = struct.pack("<Q", step + 1)
        time.sleep(0.01)
"""


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make bags with one message per chunk."""
    monkeypatch.setattr(bag_writer, "CHUNK", 1024)


@pytest.fixture
def bag(tmp_path: Path, mesh_topic: TopicInfo, small_chunks: None) -> Path:
    """Return a complete bag of two files with 30 messages, one message per chunk, as rosbag2 splits it."""
    for name, numbers in (("bag", range(20)), ("rest", range(20, 30))):
        writer = BagWriter(tmp_path / name, [mesh_topic], run=RunInfo(scene=SCENE))
        for number in numbers:
            writer.write(mesh_topic.name, np.random.default_rng(number).bytes(2000), number)
        writer.close()
    (tmp_path / "rest" / "rest_0.mcap").rename(tmp_path / "bag" / "bag_1.mcap")
    metadata = tmp_path / "bag" / "metadata.yaml"
    info = yaml.safe_load(metadata.read_text())
    info["rosbag2_bagfile_information"]["relative_file_paths"].append("bag_1.mcap")
    metadata.write_text(yaml.safe_dump(info))
    return tmp_path / "bag"


@pytest.fixture
def kill(tmp_path: Path, start_process: Callable[..., subprocess.Popen[str]]) -> Callable[[int, float], list[int]]:
    """Give a function that kills four recordings in their first seconds and returns how many messages each has lost."""

    def lose(attempt: int, seconds: float) -> int:
        path, tally = tmp_path / f"bag{attempt}", tmp_path / f"tally{attempt}"
        tally.write_bytes(bytes(16))
        process = start_process(CHILD, path, tally)
        while not any(tally.read_bytes()[8:]):
            assert process.poll() is None, process.communicate()
            time.sleep(0.01)
        time.sleep(seconds)
        process.kill()
        process.communicate()
        recorded, flushed = struct.unpack("<QQ", tally.read_bytes())
        report = recover(path)
        assert flushed <= report.total <= recorded + 1
        with Reader(report.path) as reader:
            numbers = [struct.unpack("<Q", raw[:8])[0] for _, _, raw in reader.messages()]
        assert numbers == list(range(report.total))
        with next(report.path.glob("*.mcap")).open("rb") as stream:
            assert sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages()) == report.total
        assert BagReader(report.path).run.scene == SCENE
        return recorded - report.total

    def make(seed: int, longest: float) -> list[int]:
        chance = random.Random(seed)
        return [lose(attempt, chance.uniform(0.05, longest)) for attempt in range(4)]

    return make


@pytest.mark.parametrize("seed", range(2))
def test_a_killed_recording_loses_nothing_that_was_flushed(kill: Callable[[int, float], list[int]], seed: int) -> None:
    """After SIGKILL at each of 8 random moments, a recovered bag is complete and has all flushed messages."""
    assert len(kill(seed, 0.3)) == 4
    assert FLUSH_INTERVAL < 0.1


@pytest.mark.bench
@pytest.mark.parametrize("seed", range(2))
def test_a_killed_recording_loses_at_most_a_tenth_of_a_second(
    kill: Callable[[int, float], list[int]], seed: int
) -> None:
    """After SIGKILL at each of 8 random moments, at 100 Hz with 1836 vertices, at most 10 messages are missing."""
    assert max(kill(seed, 0.9)) <= 10


def test_a_whole_bag_is_recovered_whole(bag: Path, tmp_path: Path) -> None:
    """A complete bag is recovered with all messages, files, the run and the topic."""
    report = recover(bag, tmp_path / "new")
    assert (report.total, report.cut_files, report.damaged_chunks, report.orphans) == (30, (), 0, 0)
    old, new = BagReader(bag), BagReader(tmp_path / "new")
    assert [m[:4] + m[5:] for m in new.messages()] == [m[:4] + m[5:] for m in old.messages()]
    assert (new.topics, new.run) == (old.topics, old.run)
    assert new.notes["recovered_from"] == "bag"


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_a_file_cut_anywhere_gives_a_prefix(
    tmp_path: Path,
    mesh_topic: TopicInfo,
    small_chunks: None,
    compression: CompressionType,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A file cut at any of 60 lengths gives a prefix of its messages, which grows with the length."""
    monkeypatch.setattr(bag_writer, "COMPRESSION", compression)
    writer = BagWriter(tmp_path / "bag", [mesh_topic])
    written = [np.random.default_rng(number).bytes(1100) for number in range(20)]
    for number, message in enumerate(written):
        writer.write(mesh_topic.name, message, number)
    writer.close()
    content = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    totals = []
    for index, length in enumerate(np.linspace(6000, len(content), 60, dtype=int)):
        cut = tmp_path / f"cut{index}.mcap"
        cut.write_bytes(content[:length])
        report = recover(cut)
        assert [m.data for m in BagReader(report.path).messages()] == written[: report.total]
        totals.append(report.total)
    assert totals == sorted(totals)
    assert totals[-1] == len(written)


def test_the_reserved_tail_of_zeros_does_no_harm(bag: Path) -> None:
    """With 4 MiB of zeros at the end, as after a kill, everything is recovered."""
    (bag / "metadata.yaml").unlink()
    last = bag / "bag_1.mcap"
    end = last.read_bytes().rfind(b"\x0f\x04\0\0\0\0\0\0\0")
    last.write_bytes(last.read_bytes()[:end] + bytes(4 << 20))
    with pytest.raises(RecordingError, match=r"cut off.*gdfe recover"):
        BagReader(bag)
    report = recover(bag)
    assert (report.total, report.cut_files) == (30, ("bag_1.mcap",))


@pytest.mark.parametrize(("indexed", "found"), [(True, (29, 0, 1)), (False, (10, 19, 1))])
def test_messages_whose_topic_is_lost_are_counted(bag: Path, indexed: bool, found: tuple[int, int, int]) -> None:
    """A damaged topic declaration is replaced by its copy in the index; without one, later messages have no type."""
    content = bytearray((bag / "bag_0.mcap").read_bytes())
    if not indexed:
        (bag / "metadata.yaml").unlink()
        del content[content.rfind(b"\x0f\x04\0\0\0\0\0\0\0") :]
    place = content.find(np.random.default_rng(0).bytes(2000)[500:600])
    content[place : place + 4] = b"\xff\xff\xff\xff"
    (bag / "bag_0.mcap").write_bytes(content)
    report = recover(bag)
    assert (report.total, report.orphans, report.damaged_chunks) == found


def test_a_bit_in_the_first_records_costs_a_chunk_at_most(
    tmp_path: Path, mesh_topic: TopicInfo, small_chunks: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One bit flipped before the third chunk (every 37th byte is tried) costs at most one chunk; the scene is kept."""
    scene_topic = TopicInfo(name="/gdfe_sim/scene", type="std_msgs/msg/String")
    monkeypatch.setattr(bag_writer, "COMPRESSION", CompressionType.NONE)
    writer = BagWriter(tmp_path / "bag", [scene_topic, mesh_topic], run=RunInfo(scene=SCENE))
    text = SCENE.encode() + b"\0"
    writer.write(scene_topic.name, b"\0\1\0\0" + struct.pack("<I", len(text)) + text, 0)
    for number in range(9):
        writer.write(mesh_topic.name, np.random.default_rng(number).bytes(1100), number)
    writer.close()
    content = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    end = content.find(np.random.default_rng(2).bytes(1100)[:50])
    assert 3000 < end < 20000
    for number, place in enumerate(range(0, end, 37)):
        damaged = bytearray(content)
        damaged[place] ^= 1 << (number % 8)
        (tmp_path / "damaged.mcap").write_bytes(damaged)
        report = recover(tmp_path / "damaged.mcap", tmp_path / f"out{place}")
        assert report.total >= 8, place
        assert BagReader(report.path).run.scene == SCENE, place


def test_damaged_places_all_over_a_file_cost_their_chunks(
    tmp_path: Path, mesh_topic: TopicInfo, small_chunks: None
) -> None:
    """Five destroyed record headers cost the five chunks that they start, and all other messages are recovered."""
    writer = BagWriter(tmp_path / "bag", [mesh_topic])
    for number in range(40):
        writer.write(mesh_topic.name, np.random.default_rng(number).bytes(1100), number)
    writer.close()
    content = bytearray((tmp_path / "bag" / "bag_0.mcap").read_bytes())
    for number in (5, 11, 12, 30, 39):
        head = content.find(np.random.default_rng(number).bytes(1100)[100:200])
        content[head - 200 : head] = b"\xa5" * 200
    (tmp_path / "bag" / "bag_0.mcap").write_bytes(content)
    report = recover(tmp_path / "bag", tmp_path / "new")
    found = {message.log_time for message in BagReader(tmp_path / "new").messages()}
    assert found == set(range(40)) - {5, 11, 12, 30, 39}
    assert report.missing == {mesh_topic.name: 4}  # nothing tells of the last one


def test_what_cannot_be_recovered_is_said(tmp_path: Path, bag: Path) -> None:
    """An empty directory, a file without messages and an existing output are refused."""
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="no MCAP file"):
        recover(tmp_path / "empty")
    (tmp_path / "empty" / "x.mcap").write_bytes(b"no mcap at all")
    with pytest.raises(RecordingError, match="not one whole message"):
        recover(tmp_path / "empty")
    with pytest.raises(RecordingError, match="exists and is not empty"):
        recover(bag, bag)
