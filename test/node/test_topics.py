# SPDX-License-Identifier: Apache-2.0
"""A second process commands the node over topics and receives the mesh."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from gdfe_ros.recording.reader import BagReader


def test_a_handle_turns_on_and_on(client: Any, start: Callable, coarse: dict) -> None:
    """Commanded quaternions of a growing angle give targets that pass half a turn without a jump."""
    start(**{**coarse, "scene": "twist90", "clock": "lockstep"})
    for angle in np.arange(0.5, 4.6, 0.5):
        client.target(turn=(angle, 0, 0))
    client.wait(lambda: len(client.records()) >= 10)
    turns = [record.handles["tip"].rotation[0] for record in client.records()[1:]]
    np.testing.assert_allclose(turns, np.arange(0.5, 4.6, 0.5), atol=1e-12)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_a_whole_bag_that_others_read(
    client: Any, start: Callable, coarse: dict, tmp_path: Path, number: signal.Signals
) -> None:
    """A node that records and is ended by a signal leaves a bag whose meshes rosbags and mcap-ros2 can read."""
    process = start(**coarse, record=True, bag_path=str(tmp_path / "bag"))
    for z in np.linspace(0.01, 0.1, 10):
        client.target(z)
        client.spin(0.03)
    client.wait_taken(10)
    client.wait(lambda: client.mesh()[:, 5].max() > 0.0999)
    assert process.stop(number) == 0, process.log
    assert client.mesh().shape == (21 * 9, 6)
    topology = client.last("topology")
    assert [dimension.size for dimension in topology.layout.dim] == [80, 8]
    assert max(topology.data) == 21 * 9 - 1
    live = [_stamped(message) for message in client.received["mesh"]]
    with AnyReader([tmp_path / "bag"]) as reader:
        chosen = [c for c in reader.connections if c.topic == "/gdfe_sim/mesh"]
        rosbags = [_stamped(reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages(chosen)]
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = reader.iter_decoded_messages("/gdfe_sim/mesh", log_time_order=False)
        mcap = [_stamped(message) for _, _, _, message in decoded]
    assert rosbags == mcap
    # Not all that was published arrives where the process is slow to read; what does is in the bag, in this order.
    places = [rosbags.index(message) for message in live]
    assert places == sorted(set(places))
    counts = BagReader(tmp_path / "bag").counts
    assert counts["/gdfe_sim/handles/tip/target"] == 10
    assert counts["/gdfe_sim/topology"] == counts["/gdfe_sim/scene"] == 1


def _stamped(message: Any) -> tuple[int, int, bytes]:
    return message.header.stamp.sec, message.header.stamp.nanosec, bytes(message.data)
