# SPDX-License-Identifier: Apache-2.0
"""How a sweep gains from workers: ``python -m benchmarks.sweep``.

The same cases are run with one worker and with several, from the start of the cluster to its end. On a machine that
does other things, too, the wall times say little; the CPU times still tell what the sweep costs beside its cases:
``all CPU`` is that of this process, of the scheduler in it, and of the workers with their start and imports.
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

from gdfe_ros.analysis.sweep.cases import Case, grid_cases
from gdfe_ros.analysis.sweep.runner import connect, run_cases
from gdfe_ros.scene import load_scene

SCENE = "bend5"
STEPS = 20
"""Load steps of a case: about 0.3 s."""
MODULI = (1e4, 4e4)


@dataclass(frozen=True, kw_only=True)
class SweepTiming:
    """What a sweep took.

    Attributes:
        workers: processes.
        cases: done and converged.
        start: until the cluster was there [s].
        wall: all in all [s].
        cpu: of the cases [s].
        all_cpu: of everything [s].
    """

    workers: int
    cases: int
    start: float
    wall: float
    cpu: float
    all_cpu: float

    @property
    def cores(self) -> float:
        """Cores that were at work on cases, on average, once the cluster was there."""
        return self.cpu / (self.wall - self.start)


def time_sweep(scene: str, cases: Sequence[Case], workers: int) -> SweepTiming:
    """Run cases with so many workers.

    Args:
        scene: YAML text that needs no other file.
        cases: of the sweep.
        workers: processes of one thread each.
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
    """Give the CPU time of this process and of the children that have ended [s]."""
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
