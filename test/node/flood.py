# SPDX-License-Identifier: Apache-2.0
"""A node under a flood of bad commands: refusals, published values and memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from benchmarks.node.client import Client
from gdfe_ros.node.interface.topics import MESH
from gdfe_ros.testing.process import NodeProcess
from test.node.hostile import ACTUATOR_TOPICS, HANDLE_TOPICS, actuator_commands, handle_commands
from test.node.meter import read_memory

_BATCH = 250
_PAUSE = 0.06
"""Time between two batches [s]: about 3000 commands per second, in bursts of up to ``_AHEAD``."""
_AHEAD = 1000
"""Largest number of commands in transit: the depth of a topic. With more, a slow node loses commands."""
MOST_GROWTH = 4_000_000
"""Largest growth of the resident memory [B] that counts as constant."""
_COARSE = {"scene": "bend5", "scene_overrides": ["mesh.bar.cells=[20, 2, 2]"]}
_Maker = Callable[[int], Iterator[tuple[str, bytes]]]
SCENES: Mapping[str, tuple[Mapping[str, Any], Mapping[str, type], _Maker]] = {
    "handles": (_COARSE, HANDLE_TOPICS, handle_commands),
    "actuators": ({"scene": "tendon_finger"}, ACTUATOR_TOPICS, actuator_commands),
}
"""Dict from name to the node's parameters, its topics, and the generator of bad commands."""


@dataclass(frozen=True)
class Flood:
    """Result of a flood of bad commands.

    Attributes:
        scene: name of the scene in `SCENES`.
        sent: number of bad commands.
        refused: number of refusals that the node counted.
        reasons: dict from reason to the number of refusals.
        finite: whether every mesh message had only finite numbers.
        moved: largest displacement of a vertex during the flood [m].
        memory: growth of the node's resident memory from the first ``_AHEAD`` refusals to the last refusal [B].
        status: exit status of the node after SIGINT.
    """

    scene: str
    sent: int
    refused: int
    reasons: Mapping[str, int]
    finite: bool
    moved: float
    memory: int
    status: int


def measure(scene: str, *, count: int) -> Flood:
    """Send ``count`` bad commands to a node with the wall clock."""
    parameters, topics, make = SCENES[scene]
    given = {**parameters, "command_max_age": 1.0}
    with Client(MESH, keep=(MESH,)) as client, NodeProcess(given) as node:
        client.wait(lambda: client.values.get("state") == "active")
        client.wait(lambda: client.kept[MESH.name])
        publishers = {topic: client.publisher(topic, kind) for topic, kind in topics.items()}
        client.wait(lambda: all(publisher.get_subscription_count() for publisher in publishers.values()))
        meshes = _Meshes(client)
        commands = make(1)
        before = read_memory(node.pid)
        for sent in range(0, count, _BATCH):
            client.wait(lambda sent=sent: sent + _BATCH - _refused(client) <= _AHEAD)
            if sent == _AHEAD:
                before = read_memory(node.pid)
            for _ in range(min(_BATCH, count - sent)):
                topic, data = next(commands)
                publishers[topic].publish(data)
            client.poll(_PAUSE)
            meshes.look()
        client.wait(lambda: _refused(client) >= count)
        values, after = client.next_diagnostics(), read_memory(node.pid)
        meshes.look()
        status = node.stop()
    reasons = {key.removeprefix("refused: "): int(text) for key, text in values.items() if key.startswith("refused: ")}
    refused = int(values["commands refused"])
    return Flood(scene, count, refused, reasons, meshes.finite, meshes.moved, after - before, status)


def _refused(client: Client) -> int:
    return int(client.values.get("commands refused", 0))


class _Meshes:
    """Check of all mesh messages of a client; checked messages are deleted.

    Attributes:
        finite: whether all numbers were finite so far.
        moved: largest distance of a vertex from its position in the first mesh [m].
    """

    def __init__(self, client: Client) -> None:
        self._kept = client.kept[MESH.name]
        self._first = _points(self._kept[-1])
        self.finite, self.moved = True, 0.0

    def look(self) -> None:
        """Check the messages that have arrived, and delete them."""
        for data in self._kept:
            points = _points(data)
            self.finite = self.finite and bool(np.isfinite(points).all())
            self.moved = max(self.moved, float(abs(points - self._first).max()))
        self._kept.clear()


def _points(data: bytes) -> np.ndarray:
    return np.frombuffer(deserialize_message(data, PointCloud2).data, "<f4").reshape(-1, 6)
