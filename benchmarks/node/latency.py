# SPDX-License-Identifier: Apache-2.0
"""Latency from sending a command to receiving the mesh of its step: two processes over Fast DDS, lockstep."""

from __future__ import annotations

import struct
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from benchmarks.node.client import Client, bar
from benchmarks.node.meter import read_processor
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


def measure(elements: int, *, steps: int) -> Latency:
    """Measure ``steps`` steps one by one, after warm-up steps."""
    with _Bar(elements, "") as bar_:
        for number in range(1, _WARM + steps + 1):
            bar_.take(number)
        return bar_.latency(steps)


@dataclass(frozen=True)
class Side:
    """Times of one of two nodes [ms].

    Attributes:
        p50, p99: time from command to mesh, median and 99th percentile.
        own_p50, own_p99: the same without the solve.
        processor: processor time of all threads per step.
    """

    p50: float
    p99: float
    own_p50: float
    own_p99: float
    processor: float


class Pairs(NamedTuple):
    """Steps of two nodes in turn: the same command to each, one after the other.

    Attributes:
        before, now: times of both nodes.
        ratios: for each attribute of `Side`, now over before; for the medians, the median of the pairs' ratios.
    """

    before: Side
    now: Side
    ratios: tuple[float, ...]


def compare(elements: int, *, steps: int, before: Path, now: Path) -> Pairs:
    """Measure the nodes of two directories with packages, pair by pair, so that other work slows both down equally."""
    with _Bar(elements, "/before", before) as first, _Bar(elements, "/now", now) as second:
        for number in range(1, _WARM + steps + 1):
            if number == _WARM + 1:
                started = [each.processor() for each in (first, second)]
            for each in (first, second) if number % 2 else (second, first):
                each.take(number)
        spent = [each.processor() - start for each, start in zip((first, second), started, strict=True)]
        times = [np.array(each.times[-steps:]) for each in (first, second)]
        own = [total - each.solves(steps) for total, each in zip(times, (first, second), strict=True)]
    sides = [
        Side(*(float(np.quantile(each, q)) for each in (total, without) for q in (0.5, 0.99)), 1e3 * used / steps)
        for total, without, used in zip(times, own, spent, strict=True)
    ]
    medians = [float(np.median(each[1] / each[0])) for each in (times, own)]
    first, second = sides
    tails = (second.p99 / first.p99, second.own_p99 / first.own_p99)
    return Pairs(first, second, (medians[0], tails[0], medians[1], tails[1], second.processor / first.processor))


class _Bar:
    """A node with a bar, in a process of its own, and its client; a context manager.

    Args:
        elements: number of elements of the bar.
        namespace: namespace of the node and of its topics; empty for none.
        home: directory that contains the package to run; None: this package.

    Attributes:
        times: time from command to mesh of each step [ms].
    """

    def __init__(self, elements: int, namespace: str, home: Path | None = None) -> None:
        # A step's mesh is known by its simulation time.
        parameters = {**bar(elements), "clock": "lockstep", "dt": _DT, "publish_clock": True}
        self._elements, self.times = elements, list[float]()
        self._client = Client(MESH, STRAIN, STEP_RECORD, keep=(MESH, STEP_RECORD), namespace=namespace)
        remaps = {name: name.lstrip("/") for name in ("/clock", "/diagnostics")} if namespace else None
        self._process = NodeProcess(parameters, namespace=namespace or "/", remaps=remaps, home=home)

    def __enter__(self) -> _Bar:
        self._client.__enter__()
        try:
            self._client.wait_for_node()
        except BaseException:
            self._process.__exit__(*sys.exc_info())
            raise
        return self

    def __exit__(self, *error: Any) -> None:
        self._process.__exit__(*error)
        self._client.__exit__(*error)

    def take(self, number: int) -> None:
        """Send a command, wait for the mesh with the stamp of its step, and note the time."""
        meshes = self._client.kept[MESH.name]
        meshes.clear()
        started = time.perf_counter()
        self._client.command(number)
        self._client.wait(lambda: meshes and _stamp(meshes[-1]) == round(number * _DT * 1e9))
        self.times.append(1e3 * (time.perf_counter() - started))

    def processor(self) -> float:
        """Return the processor time of the node so far [s]."""
        return read_processor(self._process.pid).total

    def solves(self, steps: int) -> np.ndarray:
        """Return the solve times of the last ``steps`` steps according to the step records [ms]."""
        self._client.wait(lambda: self._client.counts[STEP_RECORD.name] > len(self.times))
        kept = self._client.kept[STEP_RECORD.name]
        records = [StepRecord.from_json(deserialize_message(data, String).data) for data in kept]
        return 1e3 * np.array([record.wall_time for record in records[-steps:]])

    def latency(self, steps: int) -> Latency:
        """Return the quantiles of the last ``steps`` steps."""
        values = (self.times[-steps:], self.solves(steps))
        return Latency(self._elements, steps, *(float(np.quantile(each, q)) for each in values for q in (0.5, 0.99)))


def _stamp(data: bytes) -> int:
    """Return the stamp [ns] of a serialised message with a header."""
    seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
    return seconds * 10**9 + nanoseconds
