# SPDX-License-Identifier: Apache-2.0
"""Processor time of an idle node."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from benchmarks.node.client import Client
from gdfe_ros.node.interface.topics import MESH, STRAIN
from gdfe_ros.testing.process import NodeProcess
from test.node.meter import read_processor

_SETTLE = 3.0
LARGEST_SHARE = 0.01
"""Largest fraction of a core that an idle node may use."""
CASES: Mapping[str, tuple[Mapping[str, Any], bool]] = {
    "lockstep, waiting for a command": ({"clock": "lockstep"}, False),
    "wall, settled, heartbeat 1 s": ({"clock": "wall"}, False),
    "wall, paused": ({"clock": "wall"}, True),
    "fast, settled, heartbeat 1 s": ({"clock": "fast"}, False),
    "unconfigured": ({"autostart": False}, False),
}
"""Dict from name to the node's parameters, and whether the node is paused."""


@dataclass(frozen=True)
class Idleness:
    """Result for a node without commands, with subscribers of ``~/mesh``, ``~/strain`` and ``/diagnostics``.

    Attributes:
        case: name in `CASES`.
        seconds: duration of the measurement [s].
        share: processor time of all threads divided by wall time.
        meshes: number of mesh messages published in this time, one per step.
        elapsed: time from before the first count of meshes to after the last count [s]; at least ``seconds``.
    """

    case: str
    seconds: float
    share: float
    meshes: int
    elapsed: float


def measure(case: str, *, seconds: float, now: Callable[[], float] = time.monotonic) -> Idleness:
    """Start a node, let it make ten steps, and measure its processor time without further commands.

    The number of meshes is the node's own count, because an earlier message may arrive late.
    """
    parameters, paused = CASES[case]
    with Client(MESH, STRAIN) as client, NodeProcess(parameters) as node:
        client.wait(lambda: client.values.get("state"))
        if parameters.get("autostart", True):
            client.wait_for_node()
            for number in range(1, 11):
                client.command(number)
            client.wait(lambda: client.counts[MESH.name] and client.values.get("commands taken") == "10")
        if paused:
            client.pause()
        _settle(client)
        started, count = now(), _steps(client)
        first = read_processor(node.pid)
        client.poll(seconds)
        spent = read_processor(node.pid).since(first).total
        meshes = _steps(client) - count
        elapsed = now() - started
        return Idleness(case, seconds, spent / elapsed, meshes, elapsed)


def _settle(client: Client) -> None:
    """Wait until at most one heartbeat per second has been published for some time."""
    count, since = _steps(client), time.monotonic()
    while time.monotonic() < since + _SETTLE:
        last, count = count, _steps(client)
        if count > last + 2:  # two heartbeats may fall between two diagnostics
            since = time.monotonic()


def _steps(client: Client) -> int:
    return int(client.next_diagnostics().get("steps", 0))
