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
CUBE = """{bar: {size: [0.02, 0.02, 0.02], cells: [2, 2, 2]},
  material: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}"""
ALL, OK = 255, 1
_QOS = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_COUNTS = [40, pytest.param(500, marks=pytest.mark.slow)]
GROWTH = 20.0
"""Largest growth of the memory [MB] of a node in all measured changes."""
_FIRST = 20
"""Number of changes before the first measurement, in which caches fill."""
_RELEASE = 4
"""Number of diagnostics after which a node has released what it dropped (`ManagedNode.turn`)."""


def _memory(client: Any, process: NodeProcess) -> float:
    """Return the resident memory of a node [MB] after it has released what it dropped."""
    told = len(client.received["/diagnostics"]) + _RELEASE
    client.wait(lambda: len(client.received["/diagnostics"]) >= told)
    lines = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1000.0


class _Asked:
    """A client of the services that open the topics of a node anew."""

    def __init__(self, client: Any) -> None:
        from simulation_interfaces import srv

        self._client, self._srv = client, srv
        self._numbers = count()

    def spawn(self) -> str:
        """Spawn a rigid box or, each second time, a soft cube high above the scene, and return its name."""
        number = next(self._numbers)
        name = f"body{number}"
        request = self._srv.SpawnEntity.Request(name=name)
        request.entity_resource.resource_string = CUBE if number % 2 else BOX
        request.initial_pose.pose.position.z = 0.3
        result = self._client.call(self._srv.SpawnEntity, "spawn_entity", request).result
        assert result.result == OK, result.error_message
        return name

    def delete(self, name: str) -> None:
        """Delete a spawned body."""
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


@pytest.mark.parametrize("scene", ["slab", pytest.param("grasp", marks=pytest.mark.slow)])
@pytest.mark.parametrize("rebuilds", _COUNTS)
@pytest.mark.parametrize("kind", [_spawns, _resets, _lifecycles])
def test_topics_are_opened_anew_without_a_crash(
    client: Any, start: Callable, interfaces: Callable, slab: Path, kind: Callable, rebuilds: int, scene: str
) -> None:
    """Spawned and deleted bodies, resets of everything and lifecycles open the topics anew; the node goes on.

    Subscribers come and go meanwhile, which are events of the topics. Before, the node died by SIGSEGV in the second
    of these changes, because handlers of events were destroyed while the executor used them. Each change of `grasp`
    left 20 MB; later, glibc kept 50 MB of freed memory.
    """
    for package in PACKAGES:
        interfaces(package)
    process: NodeProcess = start(scene=str(slab) if scene == "slab" else scene, clock="wall", dt=0.005)
    client.wait(client.records)
    asked = _Asked(client)
    found = []
    for number, change in zip(range(rebuilds), kind(asked, client), strict=False):
        if number in (_FIRST, rebuilds // 2):
            found.append(_memory(client, process))
        client.node.create_subscription(PointCloud2, client.full("mesh"), print, _QOS)
        subscription = list(client.node.subscriptions)[-1]
        assert change is None
        client.node.destroy_subscription(subscription)
    assert process.running, process.log
    found.append(_memory(client, process))
    print(f"memory after {_FIRST}, {rebuilds // 2} and {rebuilds} changes [MB]:", found)
    assert max(found) - found[0] < GROWTH, found
    assert client.state() == "active"
    assert "Traceback" not in process.log, process.log
    assert process.stop() == 0, process.log


@pytest.mark.parametrize(
    ("scene", "cycles"),
    [
        ("small", 200),
        pytest.param("tendon_finger", 200, marks=pytest.mark.slow),
        pytest.param("pneunet", 200, marks=pytest.mark.slow),
    ],
)
def test_configure_and_cleanup_leave_nothing(
    client: Any, start: Callable, coarse: dict, scene: str, cycles: int
) -> None:
    """200 times configure, activate, deactivate and cleanup need at most 20 MB more memory than the first 20 times.

    Before, reference cycles and destroyed timers and subscriptions held the old simulations: 1 to 32 MB per cycle.
    """
    process = start(**(coarse if scene == "small" else {"scene": scene}), autostart=False)
    found = []
    for cycle in range(_FIRST + cycles + 1):
        if cycle >= _FIRST and (cycle - _FIRST) % 50 == 0:
            found.append(_memory(client, process))
        for label in ("configure", "activate", "deactivate", "cleanup"):
            assert client.transition(label)
    print("memory every 50 cycles [MB]:", found)
    assert max(found[1:]) - found[0] < GROWTH, found
