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
from test.node.meter import read_memory
from test.node.standard import Standard

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
    return 1e-6 * read_memory(process.pid)


def _named(asked: Standard, number: int) -> str:
    """Spawn a rigid box or, each second time, a soft cube high above the scene, and return its name."""
    result = asked.spawn(f"body{number}", CUBE if number % 2 else BOX, (0.0, 0.0, 0.3)).result
    assert result.result == OK, result.error_message
    return f"body{number}"


def _spawns(asked: Standard) -> Iterator[None]:
    for number in count():
        name = _named(asked, number)
        yield
        assert asked.delete(name) == OK
        yield


def _resets(asked: Standard) -> Iterator[None]:
    for number in count():
        _named(asked, number)
        yield
        assert asked.reset(ALL)[0] == OK
        yield


def _lifecycles(asked: Standard) -> Iterator[None]:
    while True:
        for label in ("deactivate", "cleanup", "configure", "activate"):
            assert asked.client.transition(label)
        yield


@pytest.mark.parametrize("scene", ["slab", pytest.param("grasp", marks=pytest.mark.slow)])
@pytest.mark.parametrize("rebuilds", _COUNTS)
@pytest.mark.parametrize("kind", [_spawns, _resets, _lifecycles])
def test_topics_are_opened_anew_without_a_crash(
    client: Any, launch: Callable, interfaces: Callable, slab: Path, kind: Callable, rebuilds: int, scene: str
) -> None:
    """Spawned and deleted bodies, resets of everything and lifecycles open the topics anew; the node goes on.

    Subscribers come and go meanwhile, which are events of the topics. Before, the node died by SIGSEGV in the second
    of these changes, because handlers of events were destroyed while the executor used them. Each change of `grasp`
    left 20 MB; later, glibc kept 50 MB of freed memory.
    """
    for package in PACKAGES:
        interfaces(package)
    process: NodeProcess = launch(scene=str(slab) if scene == "slab" else scene, clock="wall", dt=0.005)
    found = []
    for number, change in zip(range(rebuilds), kind(Standard(client)), strict=False):
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
