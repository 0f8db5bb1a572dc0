# SPDX-License-Identifier: Apache-2.0
"""Recording during a simulation: cheap, with every loss reported, and complete at the end."""

from __future__ import annotations

import signal
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording import recorder as recorder_module
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.recorder import Recorder, RecorderStatus
from gdfe_ros.recording.writer import BagWriter

MEGABYTE = b"\0\1\0\0" + bytes(1 << 20)

# Records incompressible messages until stopped, or until the limit of the file size [B] ends it.
CHILD = """
import os, resource, sys, time
from gdfe_ros.recording.recorder import Recorder, RecorderStatus
from gdfe_ros.recording.bag_info import TopicInfo

path, limit, ending = sys.argv[1], int(sys.argv[2]), sys.argv[3]
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
recorder = Recorder(path, [TopicInfo(name="/mesh", type="sensor_msgs/msg/PointCloud2")])
print("begun", flush=True)
taken = 0
try:
    for step in range(200 if limit else 100000):
        taken += recorder.record("/mesh", os.urandom(44000), step)
        if step == 20:
            print("recording", flush=True)
        time.sleep(0.005)
except KeyboardInterrupt:
    pass
if ending == "close":
    recorder.close()
    print("closed", taken, flush=True)
print("steps", step + 1, "taken", taken, "error", recorder.error, flush=True)
"""


@pytest.fixture
def stalled(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Block the disk until the event is set."""
    released = threading.Event()
    write = BagWriter.write

    def slow_write(self: BagWriter, *message: object) -> None:
        released.wait(300)
        write(self, *message)

    monkeypatch.setattr(BagWriter, "write", slow_write)
    return released


def test_every_message_arrives_in_order(
    tmp_path: Path, mesh_topic: TopicInfo, make_cloud: Callable[..., bytes]
) -> None:
    """200 recorded clouds are read back with rosbags byte for byte."""
    values = np.random.default_rng(2).normal(size=(200, 50, 6)).astype(np.float32)
    clouds = [make_cloud(cloud, index) for index, cloud in enumerate(values)]
    with Recorder(tmp_path / "bag", [mesh_topic]) as recorder:
        assert all(recorder.record(mesh_topic.name, cloud, index) for index, cloud in enumerate(clouds))
    assert (recorder.status.written, recorder.status.dropped, recorder.error) == (200, {}, None)
    with Reader(tmp_path / "bag") as reader:
        assert [(stamp, raw) for _, stamp, raw in reader.messages()] == list(enumerate(clouds))


@pytest.mark.bench
def test_record_costs_less_than_a_tenth_of_a_millisecond(tmp_path: Path, mesh_topic: TopicInfo) -> None:
    """At 100 Hz with 1836 vertices, the median processor time of `record` is below 0.1 ms."""
    data = b"\0\1\0\0" + np.random.default_rng(3).bytes(24 * 1836)
    costs = []
    with Recorder(tmp_path / "bag", [mesh_topic]) as recorder:
        for step in range(100):
            begin = time.thread_time()
            recorder.record(mesh_topic.name, data, step)
            costs.append(time.thread_time() - begin)
            time.sleep(0.01)
    assert recorder.status.written == 100
    assert np.median(costs) < 1e-4


def test_messages_are_on_disk_within_the_flush_interval(tmp_path: Path, mesh_topic: TopicInfo) -> None:
    """A recorded message is in the file soon, long before a chunk is full."""
    with Recorder(tmp_path / "bag", [mesh_topic]) as recorder:
        recorder.record(mesh_topic.name, b"\0\1\0\0needle", 0)
        deadline = time.monotonic() + 60
        while b"needle" not in (tmp_path / "bag" / "bag_0.mcap").read_bytes():
            assert time.monotonic() < deadline
            time.sleep(0.005)


def test_a_full_queue_refuses_at_once_and_counts(
    tmp_path: Path, mesh_topic: TopicInfo, stalled: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a blocked disk and a full queue, messages are refused at once, counted, and noted in the bag."""
    monkeypatch.setattr(recorder_module, "MOST_BYTES", 5 << 20)
    with Recorder(tmp_path / "bag", [mesh_topic]) as recorder:
        taken = [recorder.record(mesh_topic.name, MEGABYTE, step) for step in range(20)]
        assert recorder.status.written == 0, "who waits for room waits for the disk"
        assert recorder.status.dropped == {mesh_topic.name: 20 - sum(taken)}
        assert sum(taken) == 4
        stalled.set()
    reader = BagReader(tmp_path / "bag")
    assert len(reader) == 4
    assert reader.notes["messages_dropped"] == "16"
    assert reader.notes["messages_dropped_by_topic"] == '{"/gdfe_sim/mesh": 16}'


def test_a_run_that_waits_for_room_loses_nothing(
    tmp_path: Path, mesh_topic: TopicInfo, stalled: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a disk blocked for 0.2 s, every message of a run that waits is accepted."""
    monkeypatch.setattr(recorder_module, "MOST_BYTES", 2 << 20)
    monkeypatch.setattr(recorder_module, "LONGEST_WAIT", 300.0)
    with Recorder(tmp_path / "bag", [mesh_topic], waits=True) as recorder:
        threading.Timer(0.2, stalled.set).start()
        assert all(recorder.record(mesh_topic.name, MEGABYTE, step) for step in range(10))
        assert stalled.is_set()
    assert len(BagReader(tmp_path / "bag")) == 10


def test_the_wait_for_room_has_an_end(
    tmp_path: Path, mesh_topic: TopicInfo, stalled: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a disk blocked for longer than the longest wait, the message is refused and counted."""
    monkeypatch.setattr(recorder_module, "MOST_BYTES", 1 << 20)
    monkeypatch.setattr(recorder_module, "LONGEST_WAIT", 0.1)
    with Recorder(tmp_path / "bag", [mesh_topic], waits=True) as recorder:
        assert recorder.record(mesh_topic.name, MEGABYTE, 0)
        assert not recorder.record(mesh_topic.name, MEGABYTE, 1)
        assert recorder.status.dropped_total == 1
        stalled.set()


def test_a_failing_writer_stops_the_recording_only(
    tmp_path: Path, mesh_topic: TopicInfo, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a broken writer `record` does not raise, one report is made, and bag and status agree on the loss."""

    def broken(*_: object) -> None:
        raise TypeError("broken on purpose")

    told: list[RecorderStatus] = []
    recorder = Recorder(tmp_path / "bag", [mesh_topic], failed=told.append)
    monkeypatch.setattr(BagWriter, "write", broken)
    recorder.record(mesh_topic.name, b"", 0)
    deadline = time.monotonic() + 60
    while not told and time.monotonic() < deadline:
        assert recorder.record(mesh_topic.name, b"", 1) or recorder.error is not None
        time.sleep(0.001)
    assert not recorder.record(mesh_topic.name, b"", 1)
    status = recorder.close()
    assert isinstance(status.error, RecordingError)
    assert "broken on purpose" in str(status.error)
    assert told == [status]
    assert status.dropped_total >= 1
    notes = BagReader(tmp_path / "bag").notes
    assert "broken on purpose" in notes["error"]
    assert notes["messages_dropped"] == str(status.dropped_total)


def test_a_topic_must_be_declared(tmp_path: Path, mesh_topic: TopicInfo, command_topic: TopicInfo) -> None:
    """A message of an undeclared topic raises."""
    with Recorder(tmp_path / "bag", [mesh_topic]) as recorder, pytest.raises(RecordingError, match="is not in bag"):
        recorder.record(command_topic.name, b"\0\1\0\0", 1)


def test_closing_twice_is_harmless_and_later_messages_are_refused(tmp_path: Path, mesh_topic: TopicInfo) -> None:
    """After a close, a message is refused without an error; a second close and the bag count no dropped message."""
    recorder = Recorder(tmp_path / "bag", [mesh_topic])
    recorder.close()
    assert not recorder.record(mesh_topic.name, b"", 0)
    assert recorder.close().dropped_total == 0
    assert BagReader(tmp_path / "bag").notes["messages_dropped"] == "0"


def _finish(process: subprocess.Popen[str]) -> str:
    output, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    return output


@pytest.mark.parametrize("ending", ["close", "exit"])
def test_an_interrupted_process_leaves_a_whole_bag(
    tmp_path: Path, start_process: Callable[..., subprocess.Popen[str]], ending: str
) -> None:
    """After SIGINT, a recording process that closes, or runs to its end without closing, leaves a complete bag."""
    process = start_process(CHILD, tmp_path / "bag", 0, ending)
    assert process.stdout.readline() == "begun\n"
    assert process.stdout.readline() == "recording\n"
    process.send_signal(signal.SIGINT)
    taken = int(_finish(process).split("taken ")[1].split()[0])
    with Reader(tmp_path / "bag") as reader:
        assert sum(1 for _ in reader.messages()) == reader.message_count
        # The interrupt may fall between the recording of a message and its count.
        assert taken <= reader.message_count <= taken + 1
    assert taken > 0
