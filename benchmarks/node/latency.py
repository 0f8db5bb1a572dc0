# SPDX-License-Identifier: Apache-2.0
"""From a command sent to the mesh of its step received: two processes over Fast DDS, lockstep, one at a time."""

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
    """Times of a loop in lockstep [ms], ``~/mesh``, ``~/strain`` and ``~/step_record`` subscribed to.

    Attributes:
        elements: of the bar.
        steps: measured.
        p50: from command to mesh, median.
        p99: the same, 99th percentile.
        solve_p50: the solver's part of it, by the step records.
        solve_p99: the same, 99th percentile.
    """

    elements: int
    steps: int
    p50: float
    p99: float
    solve_p50: float
    solve_p99: float


def measure(elements: int, *, steps: int, home: Path | None = None) -> Latency:
    """Measure a loop of ``steps`` steps after some to warm up; ``home`` as for ``NodeProcess``."""
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
    """Command a step and wait for the mesh with its stamp; return the time [ms]."""
    meshes = client.kept[MESH.name]
    meshes.clear()
    started = time.perf_counter()
    client.command(number)
    client.wait(lambda: meshes and _stamp(meshes[-1]) == round(number * _DT * 1e9))
    return 1e3 * (time.perf_counter() - started)


def _stamp(data: bytes) -> int:
    """Read the stamp of a serialised message with a header [ns]."""
    seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
    return seconds * 10**9 + nanoseconds
