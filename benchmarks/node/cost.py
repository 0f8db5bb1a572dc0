# SPDX-License-Identifier: Apache-2.0
"""What a step costs beside its solve, when commands never run out.

The commands are sent at once, the node works them off in lockstep. The period of its steps less the time of the solves
is what the node adds to a step. Its other threads (publishing, recording, receiving, DDS) work on other cores while the
next step is solved; their processor time is given, too, and the time of the same solves without a node around them,
which shows what the threads take from each other.
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
from gdfe_ros.threads import STEPPER

_STEPS = 800
"""Fewer than what the command topics keep: nothing is lost though all are sent at once."""
_POLL = 0.005
_REST = 0.25
"""Without processor time in this time [s] the stepping thread has done its work."""
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
    """Means over the steps of one run [ms].

    Attributes:
        elements: of the bar.
        subscribed: whether ``~/mesh`` and ``~/strain`` have a subscriber.
        recorded: whether a bag is written.
        period: from step to step.
        solve: wall time of the solve, in the node.
        alone: the same of the same steps in a process without a node.
        delay: what the node adds: ``period`` less ``solve``.
        threads: processor time of the other threads, by name.
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
    """Have ``steps`` commands worked off, after as many to warm up."""
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
    """Send all commands, wait for their steps; return the time [s] that these took, and the processor's."""
    client.next_diagnostics()
    first, started = read_processor(pid), time.perf_counter()
    for number in numbers:
        client.command(number)
    last, end = first, started
    # The thread may also rest because others have the processor: the steps must be made as well.
    while int(client.values.get("steps", 0)) <= numbers[-1] or time.perf_counter() < end + _REST:
        client.poll(_POLL)
        reading = read_processor(pid)
        if reading.threads[STEPPER] - last.threads[STEPPER] > _IDLE:
            last, end = reading, time.perf_counter()
    return end - started, last.since(first)


def _alone(elements: int, steps: int) -> float:
    """Give the mean time of the solves [ms] of the second half of the same commands, without ROS."""
    simulation = Simulation(load_scene("bend5", overrides={"mesh.bar.cells": list(CELLS[elements])}))
    simulation.warm_up()
    times = []
    for number in range(1, 2 * steps + 1):
        command = Command(handles={"tip": Pose((0.0, 0.0, height(number)))})
        times.append(1e3 * simulation.step(command).wall_time)
    return float(np.mean(times[steps:]))
