# SPDX-License-Identifier: Apache-2.0
"""Rate [steps/s] of a batch of simulations that run one after another, in threads of one process, or in processes.

``python -m benchmarks.batches [--out FILE]`` prints the table of docs/benchmark.md. Each method runs in a process of
its own. The methods take turns, and the table shows medians. In one process, bodies with equal matrices have one common
factor. The table also shows the set-up times of the first body and of each further body.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from enum import Enum
from functools import cache
from statistics import mean, median
from time import perf_counter
from typing import Any

from benchmarks.markdown import markdown_table
from benchmarks.peers.peer import worker_environment
from benchmarks.replay import first_steps
from benchmarks.report import options, write_report

SCENE = "bend5"
MESHES = ((10, 1, 1), (20, 2, 2), (50, 5, 5))
BATCH, STEPS, REPEATS = 8, 50, 3
"""Number of simulations, steps of each simulation, and runs of each method."""
TIMEOUT = 600.0


class Way(str, Enum):
    """Method of running a batch."""

    ALONE = "one after another"
    THREADS = "threads"
    PROCESSES = "processes"


def measure(cells: tuple[int, int, int], workers: int) -> dict[str, Any]:
    """Run a batch with each method in turn; return the rates [steps/s] and the set-up times in one process [s].

    Raises:
        subprocess.CalledProcessError: a run failed.
    """
    runs = {way: [] for way in Way}
    for _ in range(REPEATS):
        for way in Way:
            command = [sys.executable, "-m", "benchmarks.batches", way.value, json.dumps(cells), str(workers)]
            environment = worker_environment(1)
            done = subprocess.run(
                command, env=environment, stdout=subprocess.PIPE, text=True, timeout=TIMEOUT, check=True
            )
            runs[way].append(json.loads(done.stdout))
    return {
        "cells": list(cells),
        "workers": workers,
        "rates": {way.value: median(run["rate"] for run in found) for way, found in runs.items()},
        "first": median(run["first"] for run in runs[Way.ALONE]),
        "further": median(run["further"] for run in runs[Way.ALONE]),
    }


def batch_table(report: Sequence[dict[str, Any]]) -> str:
    """Return the comparison as a Markdown table."""
    rows = [
        ("x".join(map(str, item["cells"])), *(f"{item['rates'][way.value]:.0f}" for way in Way),
         f"{1e3 * item['first']:.1f}", f"{1e3 * item['further']:.1f}")
        for item in report
    ]  # fmt: skip
    several = (f"{report[0]['workers']} {way.value}, steps/s" for way in (Way.THREADS, Way.PROCESSES))
    heads = (
        "cells",
        f"{Way.ALONE.value}, steps/s",
        *several,
        "set-up of the first [ms]",
        "set-up of each further one [ms]",
    )
    return markdown_table(heads, rows)


def _batch(way: Way, cells: list[int], workers: int) -> dict[str, float]:
    """Run one batch with one method, and return its rate [steps/s] and, in one process, the set-up times [s]."""
    if way is Way.PROCESSES:
        with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
            return {"rate": _rate(pool, _play_anew, [cells] * BATCH)}
    _play(_simulation(cells))  # compiled, or loaded; and forgotten, factor and all
    gc.collect()
    made, simulations = [], []
    for _ in range(BATCH):
        begun = perf_counter()
        simulations.append(_simulation(cells))
        made.append(perf_counter() - begun)
    with ThreadPoolExecutor(workers if way is Way.THREADS else 1) as pool:
        rate = _rate(pool, _play, simulations)
    return {"rate": rate, "first": made[0], "further": mean(made[1:])}


def _rate(pool: Executor, play: Callable[[Any], None], batch: Sequence[Any]) -> float:
    """Return the rate [steps/s] of a batch, after a first run of the batch that is not timed."""
    list(pool.map(play, batch))
    begun = perf_counter()
    list(pool.map(play, batch))
    return BATCH * STEPS / (perf_counter() - begun)


def _simulation(cells: list[int]) -> Any:
    from gdfe_ros import Simulation

    return Simulation(_scene(tuple(cells)))


@cache
def _scene(cells: tuple[int, int, int]) -> Any:
    from gdfe_ros.scene import load_scene

    return load_scene(SCENE, overrides={"mesh.bar.cells": list(cells), "solver.threads": 1})


def _play(simulation: Any) -> None:
    simulation.reset()
    if not all(result.converged for result in simulation.play(STEPS)):
        raise RuntimeError(f"{SCENE}: {simulation.result.message}")


_OWN: dict[str, Any] = {}
"""Dict from cells to the simulation of this worker process; each simulation is made once."""


def _play_anew(cells: list[int]) -> None:
    key = str(cells)
    if key not in _OWN:
        _OWN[key] = _simulation(cells)
    _play(_OWN[key])


def probe() -> dict[str, float]:
    """Return the figures of the first steps on every mesh."""
    found: dict[str, float] = {}
    for cells in MESHES:
        found |= first_steps("x".join(map(str, cells)), _simulation(list(cells)), STEPS)
    return found


def main() -> None:
    """Run the measurement, write the report and print the table."""
    given = options("benchmarks.batches", "Many simulations at once.", "batches").parse_args()
    report = [measure(cells, os.cpu_count() or 1) for cells in MESHES]
    write_report(given.out, report, probe())
    print(batch_table(report))


if __name__ == "__main__":
    if len(sys.argv) == 4 and not sys.argv[1].startswith("-"):
        print(json.dumps(_batch(Way(sys.argv[1]), json.loads(sys.argv[2]), int(sys.argv[3]))))
    else:
        main()
