# SPDX-License-Identifier: Apache-2.0
"""Topics are opened anew hundreds of times, with every optional package of messages that ROS from apt has."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2

from gdfe_ros.testing import NodeProcess

PACKAGES = ("tf2_msgs", "simulation_interfaces", "control_msgs")
BOX = "{box: {size: [0.02, 0.02, 0.02]}, mass: 0.01}"
ALL, OK = 255, 1
_QOS = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_COUNTS = [40, pytest.param(500, marks=pytest.mark.slow)]


class _Asked:
    """A client of the services that open the topics of a node anew."""

    def __init__(self, client: Any) -> None:
        from simulation_interfaces import srv

        self._client, self._srv = client, srv
        self._numbers = count()

    def spawn(self) -> str:
        """Spawn a box high above the scene, and return its name."""
        name = f"box{next(self._numbers)}"
        request = self._srv.SpawnEntity.Request(name=name)
        request.entity_resource.resource_string = BOX
        request.initial_pose.pose.position.z = 0.3
        result = self._client.call(self._srv.SpawnEntity, "spawn_entity", request).result
        assert result.result == OK, result.error_message
        return name

    def delete(self, name: str) -> None:
        """Delete a spawned box."""
        result = self._client.call(self._srv.DeleteEntity, "delete_entity", self._srv.DeleteEntity.Request(entity=name))
        assert result.result.result == OK, result.result.error_message

    def reset(self) -> None:
        """Reset everything, also what was spawned."""
        request = self._srv.ResetSimulation.Request(scope=ALL)
        result = self._client.call(self._srv.ResetSimulation, "reset_simulation", request).result
        assert result.result == OK, result.error_message


def _spawns(asked: _Asked, client: Any) -> Iterator[None]:
    while True:
        name = asked.spawn()
        yield
        asked.delete(name)
        yield


def _resets(asked: _Asked, client: Any) -> Iterator[None]:
    while True:
        asked.spawn()
        yield
        asked.reset()
        yield


def _lifecycles(asked: _Asked, client: Any) -> Iterator[None]:
    while True:
        for label in ("deactivate", "cleanup", "configure", "activate"):
            assert client.transition(label)
        yield


@pytest.mark.parametrize("rebuilds", _COUNTS)
@pytest.mark.parametrize("kind", [_spawns, _resets, _lifecycles])
def test_topics_are_opened_anew_without_a_crash(
    client: Any, start: Callable, interfaces: Callable, slab: Path, kind: Callable, rebuilds: int
) -> None:
    """Spawned and deleted bodies, resets of everything and lifecycles open the topics anew; the node goes on.

    Subscribers come and go meanwhile, which are events of the topics. Before, the node died by SIGSEGV in the second
    of these changes, because handlers of events were destroyed while the executor used them.
    """
    for package in PACKAGES:
        interfaces(package)
    process: NodeProcess = start(scene=str(slab), clock="wall", dt=0.005)
    client.wait(client.records)
    asked = _Asked(client)
    for _, change in zip(range(rebuilds), kind(asked, client), strict=False):
        client.node.create_subscription(PointCloud2, client.full("mesh"), print, _QOS)
        subscription = list(client.node.subscriptions)[-1]
        assert change is None
        client.node.destroy_subscription(subscription)
    assert process.running, process.log
    assert client.state() == "active"
    assert "Traceback" not in process.log, process.log
    assert process.stop() == 0, process.log
