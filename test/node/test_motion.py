# SPDX-License-Identifier: Apache-2.0
"""A node whose body has mass: what it tells of the motion, and how it steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_DROP = {"scene": "drop", "scene_overrides": ["mesh.bar.cells=[10, 1, 1]"]}


@pytest.fixture
def listen(client: Any) -> Callable[..., list[Any]]:
    """Give a function that subscribes the client to a topic of the node and returns the list of what arrives."""

    def subscribe(topic: str, kind: type) -> list[Any]:
        client.node.create_subscription(kind, client.full(topic), client.received[topic].append, _QOS)
        return client.received[topic]

    return subscribe


def _advance(client: Any, steps: int = 1) -> None:
    """Have a node in lockstep make steps."""
    for _ in range(steps):
        response = client.call(Trigger, "step", Trigger.Request())
        assert response.success, response.message


def test_every_vertex_tells_its_velocity(client: Any, start: Callable, listen: Callable) -> None:
    """Release a bar: at first it stands, then each vertex has the velocity that its positions show."""
    listen("velocity", PointCloud2)
    start(**_DROP, clock="lockstep", dt=0.001)
    first = client.last("velocity")
    assert [field.name for field in first.fields] == ["x", "y", "z", "vx", "vy", "vz"]
    assert first.header.frame_id == "base_link"
    assert not _columns(first)[:, 3:].any()
    _advance(client, 20)
    client.wait(lambda: len(client.received["velocity"]) == 21 and len(client.received["mesh"]) == 21)
    before, now, after = (_columns(message) for message in client.received["velocity"][-3:])
    np.testing.assert_allclose(now[:, :3], client.meshes()[-2][:, :3])
    np.testing.assert_allclose(now[:, 3:], (after[:, :3] - before[:, :3]) / 0.002, atol=1e-3)
    assert now[:, 5].min() < -0.1


def test_energies_are_told_by_records_and_diagnostics(client: Any, start: Callable) -> None:
    """Release a bar without damping: what its weight gives is kinetic and elastic energy, and diagnostics say so."""
    start(**_DROP, clock="lockstep", dt=0.002)
    client.wait(client.records)
    _advance(client, 20)
    client.wait(lambda: len(client.records()) == 21)
    energies = client.record().energies
    assert list(energies) == ["kinetic", "elastic", "potential", "work", "dissipated"]
    assert energies["kinetic"] > 0.001
    assert energies["kinetic"] + energies["elastic"] == pytest.approx(-energies["potential"], rel=0.02)
    told = client.diagnostics()
    assert [told[f"energy: {name} [J]"] for name in energies] == [f"{value:.6g}" for value in energies.values()]


def test_a_scene_without_dynamics_has_no_topic_of_motion(client: Any, start: Callable, coarse: dict) -> None:
    """Look at the topics of a node whose body has no mass."""
    start(**coarse)
    client.wait(client.records)
    names = {name for name, _ in client.node.get_publisher_names_and_types_by_node("gdfe_sim", "/")}
    assert "/gdfe_sim/mesh" in names
    assert "/gdfe_sim/velocity" not in names


def _columns(cloud: PointCloud2) -> np.ndarray:
    return np.frombuffer(cloud.data, "<f4").reshape(-1, 6)
