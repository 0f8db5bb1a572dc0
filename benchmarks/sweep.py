# SPDX-License-Identifier: Apache-2.0
"""Speed-up of a sweep by several workers: ``python -m benchmarks.sweep``.

The same cases are run with one worker and with several workers, from the start of the cluster to its end. On a busy
machine the wall times are not reliable, but the CPU times still show the cost of the sweep in addition to its cases.
``all CPU`` is the CPU time of this process with its scheduler, and of the workers with their start and imports.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from gdfe_ros.analysis.sweep import Case, grid_cases, run_cases
from gdfe_ros.scene import load_scene
from gdfe_ros.workers import connect

SCENE = "bend5"
STEPS = 20
"""Number of load steps of a case, which takes about 0.3 s."""
MODULI = (1e4, 4e4)


@dataclass(frozen=True, kw_only=True)
class SweepTiming:
    """Times of a sweep.

    Attributes:
        workers: number of processes.
        cases: number of cases that converged.
        start: wall time of starting the cluster [s].
        wall: total wall time [s].
        cpu: CPU time of the cases [s].
        all_cpu: total CPU time [s].
    """

    workers: int
    cases: int
    start: float
    wall: float
    cpu: float
    all_cpu: float

    @property
    def cores(self) -> float:
        """Mean number of cores that computed cases after the start of the cluster."""
        return self.cpu / (self.wall - self.start)


def time_sweep(scene: str, cases: Sequence[Case], workers: int) -> SweepTiming:
    """Run cases with a number of workers, and return the times.

    Args:
        scene: YAML text that needs no other file.
        cases: cases of the sweep.
        workers: number of processes, with one thread each.
    """
    begun, used = time.perf_counter(), _cpu_time()
    with connect(None, workers) as client:
        start = time.perf_counter() - begun
        results = [result for _, result in run_cases(client, scene, cases)]
    return SweepTiming(
        workers=workers,
        cases=sum(result["status"] == "converged" for result in results),
        start=start,
        wall=time.perf_counter() - begun,
        cpu=sum(result["cpu_time"] for result in results),
        all_cpu=_cpu_time() - used,
    )


def _cpu_time() -> float:
    """Return the CPU time of this process and of its ended child processes [s]."""
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Time a sweep with one worker and with several.")
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    given = parser.parse_args(arguments)
    scene = load_scene(SCENE, overrides={"solver.steps": STEPS}).source
    cases = grid_cases({"materials.e20.young": np.linspace(*MODULI, given.cases).tolist()})
    timings = [time_sweep(scene, cases, workers) for workers in given.workers]
    first, table = timings[0], Table(title=f"{given.cases} cases of {SCENE}, {STEPS} load steps each")
    for column in (
        "workers",
        "converged",
        "start [s]",
        "wall [s]",
        "CPU of cases [s]",
        "all CPU [s]",
        "cores",
        "faster",
    ):
        table.add_column(column, justify="right")
    for timing in timings:
        numbers = (timing.start, timing.wall, timing.cpu, timing.all_cpu, timing.cores, first.wall / timing.wall)
        table.add_row(str(timing.workers), str(timing.cases), *(f"{number:.2f}" for number in numbers))
    console = Console(width=110)
    console.print(table)
    console.print(f"load of this machine now: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
