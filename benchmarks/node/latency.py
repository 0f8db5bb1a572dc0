# SPDX-License-Identifier: Apache-2.0
"""``make bench-node``: latency from sending a command to receiving the mesh of its step, in lockstep over Fast DDS."""

from __future__ import annotations

import os
import struct
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from benchmarks.markdown import markdown_table
from benchmarks.node.client import CELLS, Client, bar, height
from benchmarks.replay import figures
from benchmarks.report import run_script
from gdfe_ros.constraints import Pose
from gdfe_ros.node.interface.topics import MESH, STEP_RECORD, STRAIN
from gdfe_ros.recording.step import StepRecord
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.testing.node_process import NodeProcess

_DT = 0.01
_WARM, STEPS = 20, 300
"""Numbers of steps to warm up, and of measured ones."""
PROBED = 20
"""Number of steps of the probe."""


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


def measure(elements: int, *, steps: int) -> Latency:
    """Measure ``steps`` steps one by one, after warm-up steps."""
    # A step's mesh is known by its simulation time.
    parameters = {**bar(elements), "clock": "lockstep", "dt": _DT, "publish_clock": True}
    times = []
    with Client(MESH, STRAIN, STEP_RECORD, keep=(MESH, STEP_RECORD)) as client, NodeProcess(parameters):
        client.wait_for_node()
        meshes, records = client.kept[MESH.name], client.kept[STEP_RECORD.name]
        for number in range(1, _WARM + steps + 1):
            stamp = round(number * _DT * 1e9)
            meshes.clear()
            started = time.perf_counter()
            client.command(number)
            client.wait(lambda stamp=stamp: meshes and _stamp(meshes[-1]) == stamp)
            times.append(1e3 * (time.perf_counter() - started))
        client.wait(lambda: client.counts[STEP_RECORD.name] > len(times))
    texts = [deserialize_message(data, String).data for data in records[-steps:]]
    solves = [1e3 * StepRecord.from_json(text).wall_time for text in texts]
    quantiles = (float(np.quantile(values, q)) for values in (times[-steps:], solves) for q in (0.5, 0.99))
    return Latency(elements, steps, *quantiles)


def measure_all() -> list[dict[str, Any]]:
    """Return the latencies of all bars; the nodes are reached from this machine only."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    return [asdict(measure(elements, steps=STEPS)) for elements in CELLS]


def _stamp(data: bytes) -> int:
    """Return the stamp [ns] of a serialised message with a header."""
    seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
    return seconds * 10**9 + nanoseconds


def latency_table(items: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Return the table of the times from a command to its mesh, under its name."""
    heads = ("elements", "command to mesh, p50 [ms]", "command to mesh, p99 [ms]", "solve, p50 [ms]", "solve, p99 [ms]")
    names = ("p50", "p99", "solve_p50", "solve_p99")
    rows = [(str(item["elements"]), *(f"{item[name]:.2f}" for name in names)) for item in items]
    return {"latency": markdown_table(heads, rows)}


def probe() -> dict[str, float]:
    """Return the figures of the first steps of two bars, without a node."""
    found: dict[str, float] = {}
    for elements in (500, 1250):
        simulation = Simulation(load_scene("bend5", overrides={"mesh.bar.cells": list(CELLS[elements])}))
        lifts = (Command(handles={"tip": Pose((0.0, 0.0, height(number)))}) for number in range(1, PROBED + 1))
        found |= figures(f"{elements} elements", map(simulation.step, lifts), simulation)
    return found


if __name__ == "__main__":
    run_script(
        "benchmarks.node.latency",
        "Latency of a node.",
        "bench_node",
        measure=measure_all,
        tables=latency_table,
        probe=probe,
    )
