# SPDX-License-Identifier: Apache-2.0
"""Cost of a step in addition to its solve, if a next command is always available.

All commands are sent at once, and the node processes them in lockstep. The time that the node adds to a step is the
period of the steps minus the time of the solves. The node's other threads (publishing, recording, receiving, DDS) work
on other cores while the next step is solved. Their processor time is measured, too. The time of the same solves without
a node shows by how much the threads slow each other down.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.node.client import CELLS, Client, bar, height
from benchmarks.node.meter import Reading, read_processor
from gdfe_ros.constraints import Pose
from gdfe_ros.node.interface.topics import MESH, STRAIN
from gdfe_ros.scene.loader import load_scene
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.testing.process import NodeProcess
from gdfe_ros.workers import STEPPER

_STEPS = 800
"""Number of steps. It is below the depth of the command topics, so that no command is lost if all are sent at once."""
_POLL = 0.005
_REST = 0.25
"""If the stepping thread uses no processor time for this time [s], it has finished its work."""
_IDLE = 1e-4
CASES: tuple[dict[str, Any], ...] = (
    {"elements": 500, "subscribed": False, "recorded": False},
    {"elements": 500, "subscribed": True, "recorded": True},
    {"elements": 1250, "subscribed": False, "recorded": False},
    {"elements": 1250, "subscribed": True, "recorded": False},
    {"elements": 1250, "subscribed": True, "recorded": True},
)


@dataclass(frozen=True)
class Cost:
    """Mean times of a step in one run [ms].

    Attributes:
        elements: number of elements of the bar.
        subscribed: whether ``~/mesh`` and ``~/strain`` have a subscriber.
        recorded: whether a bag is written.
        period: time from step to step.
        solve: wall time of the solve in the node.
        alone: wall time of the same solve in a process without a node.
        delay: time that the node adds: ``period`` minus ``solve``.
        threads: dict from name to processor time, for all threads except the stepping thread.
    """

    elements: int
    subscribed: bool
    recorded: bool
    period: float
    solve: float
    alone: float
    delay: float
    threads: dict[str, float]


def measure(elements: int, *, subscribed: bool, recorded: bool, steps: int = _STEPS) -> Cost:
    """Measure a node that processes ``steps`` commands, after the same number of commands to warm up."""
    alone = _alone(elements, steps)
    topics = (MESH, STRAIN) if subscribed else ()
    with tempfile.TemporaryDirectory() as folder, Client(*topics) as client:
        parameters = {
            **bar(elements),
            "clock": "lockstep",
            "record": recorded,
            "bag_path": str(Path(folder) / "bag"),
        }
        with NodeProcess(parameters) as node:
            client.wait_for_node()
            _work_off(client, node.pid, range(1, steps + 1))
            before = client.solved[1]
            span, used = _work_off(client, node.pid, range(steps + 1, 2 * steps + 1))
            solve = 1e3 * (client.solved[1] - before) / steps
    period = 1e3 * span / steps
    threads = {name: 1e3 * spent / steps for name, spent in used.threads.items() if name != STEPPER}
    return Cost(elements, subscribed, recorded, period, solve, alone, period - solve, threads)


def _work_off(client: Client, pid: int, numbers: range) -> tuple[float, Reading]:
    """Send all commands and wait for their steps; return their wall time [s] and the processor times of the threads."""
    client.next_diagnostics()
    first, started = read_processor(pid), time.perf_counter()
    for number in numbers:
        client.command(number)
    last, end = first, started
    # The thread may also be idle because other threads use the processor. Therefore the steps are counted, too.
    while int(client.values.get("steps", 0)) <= numbers[-1] or time.perf_counter() < end + _REST:
        client.poll(_POLL)
        reading = read_processor(pid)
        if reading.threads[STEPPER] - last.threads[STEPPER] > _IDLE:
            last, end = reading, time.perf_counter()
    return end - started, last.since(first)


def _alone(elements: int, steps: int) -> float:
    """Return the mean solve time [ms] of the second half of the same commands, without ROS."""
    simulation = Simulation(load_scene("bend5", overrides={"mesh.bar.cells": list(CELLS[elements])}))
    simulation.warm_up()
    times = []
    for number in range(1, 2 * steps + 1):
        command = Command(handles={"tip": Pose((0.0, 0.0, height(number)))})
        times.append(1e3 * simulation.step(command).wall_time)
    return float(np.mean(times[steps:]))
