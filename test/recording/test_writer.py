# SPDX-License-Identifier: Apache-2.0
"""Bags of BagWriter are read back by two foreign readers and by ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import PointCloud2

import gdfe_ros
from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import Qos, TopicInfo
from gdfe_ros.recording.decoding import array_decoder
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.writer import BagWriter

STEP = 10_000_000
SCENE = "name: bar\ndescription: Übung, 5 µm\n"


@pytest.fixture
def values() -> np.ndarray:
    """Return 40 clouds of 100 vertices, (40, 100, 6) float32."""
    return np.random.default_rng(1).normal(size=(40, 100, 6)).astype(np.float32)


@pytest.fixture
def write_bag(tmp_path: Path, values: np.ndarray, mesh_topic: TopicInfo, make_cloud: Callable[..., bytes]):
    """Give a function that writes the clouds, one every 10 ms."""

    def write() -> Path:
        path = tmp_path / "bag"
        writer = BagWriter(path, [mesh_topic], run=RunInfo(scene=SCENE))
        for index, cloud in enumerate(values):
            writer.write(mesh_topic.name, make_cloud(cloud, index * STEP), index * STEP)
        writer.close({"messages_dropped": "0"})
        return path

    return write


def _as_array(message: object) -> np.ndarray:
    return np.frombuffer(bytes(message.data), "<f4").reshape(-1, 6)


def test_rosbags_reads_equal_arrays(write_bag: Callable, values: np.ndarray) -> None:
    """The library rosbags reads every cloud back."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(write_bag()) as reader:
        found = [(stamp, _as_array(store.deserialize_cdr(raw, c.msgtype))) for c, stamp, raw in reader.messages()]
        assert reader.message_count == len(values)
        assert reader.connections[0].digest == store.hash_rihs01("sensor_msgs/msg/PointCloud2")
    assert [stamp for stamp, _ in found] == [index * STEP for index in range(len(values))]
    np.testing.assert_array_equal([array for _, array in found], values)


def test_mcap_ros2_reads_equal_arrays(write_bag: Callable, values: np.ndarray) -> None:
    """The reader of mcap and its ROS 2 decoder read every cloud back, with checksums checked."""
    with (write_bag() / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        found = [_as_array(item.decoded_message) for item in reader.iter_decoded_messages()]
    np.testing.assert_array_equal(found, values)


@pytest.mark.parametrize("use_rclpy", [False, True])
def test_our_reader_gives_messages_and_run(write_bag: Callable, values: np.ndarray, use_rclpy: bool) -> None:
    """BagReader reads back messages, topic, times, notes and the embedded run."""
    reader = BagReader(write_bag())
    decode = array_decoder(reader.topics.values())
    messages = list(reader.messages())
    decoded = [deserialize_message(m.data, PointCloud2) if use_rclpy else decode(m.type, m.data) for m in messages]
    np.testing.assert_array_equal([_as_array(item) for item in decoded], values)
    assert [m.sequence for m in messages] == list(range(len(values)))
    assert (len(reader), reader.start, reader.end) == (40, 0, 39 * STEP)
    assert reader.notes == {"messages_dropped": "0"}
    assert reader.run == RunInfo(scene=SCENE)
    assert reader.run.package_version == gdfe_ros.__version__
    assert {"platform", "processor", "numpy", "numba"} <= set(reader.run.machine)


def test_our_reader_selects_topics(tmp_path: Path, mesh_topic: TopicInfo, command_topic: TopicInfo) -> None:
    """BagReader selects one topic, and refuses an unknown topic."""
    writer = BagWriter(tmp_path / "bag", [mesh_topic, command_topic])
    for index in range(10):
        writer.write(mesh_topic.name, b"\0\1\0\0mesh", index)
        writer.write(command_topic.name, b"\0\1\0\0pose", index, publish_time=index + 5)
    writer.close()
    reader = BagReader(tmp_path / "bag")
    chosen = list(reader.messages([command_topic.name]))
    assert [(m.topic, m.type, m.log_time, m.publish_time) for m in chosen] == [
        (command_topic.name, command_topic.type, time, time + 5) for time in range(10)
    ]
    with pytest.raises(RecordingError, match=r"no topic \['/nowhere'\]; it has .*mesh"):
        reader.messages(["/nowhere"])


def test_metadata_is_version_9(write_bag: Callable) -> None:
    """metadata.yaml conforms to rosbag2's version 9, with the notes as custom data."""
    path = write_bag()
    info = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (info["version"], info["storage_identifier"], info["message_count"]) == (9, "mcap", 40)
    assert info["duration"] == {"nanoseconds": 39 * STEP}
    assert info["relative_file_paths"] == ["bag_0.mcap"]
    assert info["custom_data"] == {"messages_dropped": "0"}
    entry = info["topics_with_message_count"][0]["topic_metadata"]
    assert entry["type_description_hash"].startswith("RIHS01_")
    assert entry["offered_qos_profiles"][0]["reliability"] == "reliable"
    with (path / "bag_0.mcap").open("rb") as stream:
        records = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}
    assert yaml.safe_load(records["rosbag2"]["serialized_metadata"]) == info


def test_quality_of_service_survives(tmp_path: Path, mesh_topic: TopicInfo) -> None:
    """The profile of a latched best-effort topic is read back."""
    qos = Qos(reliability="best_effort", durability="transient_local", history="keep_all", depth=0)
    BagWriter(tmp_path / "bag", [replace(mesh_topic, qos=qos)]).close()
    assert BagReader(tmp_path / "bag").topics[mesh_topic.name].qos == qos


def test_qos_is_taken_from_rclpy() -> None:
    """The sensor profile of rclpy is converted."""
    from rclpy.qos import qos_profile_sensor_data

    assert Qos.from_rclpy(qos_profile_sensor_data) == Qos(reliability="best_effort", depth=5)


def test_chunks_are_small(write_bag: Callable) -> None:
    """By default a bag has many small chunks, compressed with lz4."""
    with (write_bag() / "bag_0.mcap").open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    assert {chunk.compression for chunk in chunks} == {"lz4"}
    assert max(chunk.uncompressed_size for chunk in chunks) < 100_000


def test_an_empty_bag_is_whole(tmp_path: Path, mesh_topic: TopicInfo) -> None:
    """A bag closed without a message is accepted by both readers."""
    BagWriter(tmp_path / "bag", [mesh_topic]).close()
    assert len(BagReader(tmp_path / "bag")) == 0
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 0


def test_mistakes_are_refused(tmp_path: Path, mesh_topic: TopicInfo, command_topic: TopicInfo) -> None:
    """An existing directory, an unknown topic, a changed type and a closed bag are refused."""
    writer = BagWriter(tmp_path / "bag", [mesh_topic])
    with pytest.raises(RecordingError, match="exists and is not empty"):
        BagWriter(tmp_path / "bag")
    with pytest.raises(RecordingError, match=r"/other is not in bag"):
        writer.write("/other", b"", 0)
    with pytest.raises(RecordingError, match="is of type sensor_msgs/msg/PointCloud2, not geometry_msgs"):
        writer.add_topic(replace(command_topic, name=mesh_topic.name))
    writer.close()
    with pytest.raises(RecordingError, match="is closed"):
        writer.write(mesh_topic.name, b"", 0)
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot be begun"):
        BagWriter(tmp_path / "file" / "bag")
