# SPDX-License-Identifier: Apache-2.0
"""Latency from sending a command to receiving the mesh of its step: two processes over Fast DDS, lockstep."""

from __future__ import annotations

import struct
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from benchmarks.node.client import Client, bar
from gdfe_ros.node.interface.topics import MESH, STEP_RECORD, STRAIN
from gdfe_ros.recording.step_record import StepRecord
from gdfe_ros.testing.process import NodeProcess

_DT = 0.01
_WARM = 20


@dataclass(frozen=True)
class Latency:
    """Times in lockstep [ms], with a subscriber of ``~/mesh``, ``~/strain`` and ``~/step_record``.

    Attributes:
        elements: number of elements of the bar.
        steps: number of measured steps.
        p50: time from command to mesh, median.
        p99: time from command to mesh, 99th percentile.
        solve_p50: solve time according to the step records, median.
        solve_p99: solve time according to the step records, 99th percentile.
    """

    elements: int
    steps: int
    p50: float
    p99: float
    solve_p50: float
    solve_p99: float


def measure(elements: int, *, steps: int, home: Path | None = None) -> Latency:
    """Measure ``steps`` steps one by one, after warm-up steps; ``home`` is the directory of the node's package."""
    parameters = {
        **bar(elements),
        "clock": "lockstep",
        "dt": _DT,
        "publish_clock": True,  # a step's mesh is known by its simulation time
    }
    with Client(MESH, STRAIN, STEP_RECORD, keep=(MESH, STEP_RECORD)) as client, NodeProcess(parameters, home=home):
        client.wait_for_node()
        times = [_round_trip(client, number) for number in range(1, _WARM + steps + 1)][_WARM:]
        client.wait(lambda: client.counts[STEP_RECORD.name] > steps + _WARM)
        texts = [deserialize_message(data, String).data for data in client.kept[STEP_RECORD.name]]
    solves = [1e3 * StepRecord.from_json(text).wall_time for text in texts][-steps:]
    quantiles = [float(np.quantile(values, share)) for values in (times, solves) for share in (0.5, 0.99)]
    return Latency(elements, steps, *quantiles)


def _round_trip(client: Client, number: int) -> float:
    """Send a command and wait for the mesh with the stamp of its step; return the time [ms]."""
    meshes = client.kept[MESH.name]
    meshes.clear()
    started = time.perf_counter()
    client.command(number)
    client.wait(lambda: meshes and _stamp(meshes[-1]) == round(number * _DT * 1e9))
    return 1e3 * (time.perf_counter() - started)


def _stamp(data: bytes) -> int:
    """Return the stamp [ns] of a serialised message with a header."""
    seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
    return seconds * 10**9 + nanoseconds
