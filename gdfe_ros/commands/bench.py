# SPDX-License-Identifier: Apache-2.0
"""``gdfe bench``: run time against error beside FElupe, CalculiX and MuJoCo; streaming; scaling."""

from __future__ import annotations

import argparse
import json
import os
import platform
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from gdfe_ros.benchmark.cold import Job, jobs, missing, run_jobs
from gdfe_ros.benchmark.peers.peer import PeerError, PeerResult
from gdfe_ros.benchmark.scaling import measure_ratios, measure_scaling
from gdfe_ros.benchmark.series import PAPER, exact_joint, simulated_joint
from gdfe_ros.benchmark.tables import all_tables
from gdfe_ros.materials import Law
from gdfe_ros.solver.settings import Policy


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--out", type=Path, default=Path("runs/bench"), help="directory of bench.json and the picture")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each kind; the median counts (default: 3)")
    parser.add_argument("--quick", action="store_true", help="leave out runs of more than ten seconds")


def run(arguments: argparse.Namespace) -> int:
    """Measure, write bench.json and the picture, print the tables; return 1 where a run failed."""
    console, failures = Console(), []
    for name, reason in missing().items():
        console.print(f"missing: {name}: {reason}", style="yellow")

    def done(job: Job, outcome: PeerResult | PeerError) -> None:
        where = f"{job.solver.value:9} {job.case.name.value:16} {job.variant.label}"
        if isinstance(outcome, PeerError):
            failures.append(str(outcome))
            console.print(f"{where}: {outcome}", style="red")
        else:
            console.print(f"{where}: {1e3 * outcome.time_solve:.1f} ms, {100 * outcome.mean_error:.3f} %")

    wanted = jobs(slow=not arguments.quick, threads=os.cpu_count() or 1)
    results = run_jobs(wanted, repeats=arguments.repeats, done=done)
    report = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}",
        "missing": missing(),
        "failures": failures,
        "results": [result.to_json() for result in results],
        "joint": _joints(),
        "scaling": measure_scaling(),
        "ratios": measure_ratios(),
    }
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "bench.json").write_text(json.dumps(report, indent=1))
    _draw(arguments.out / "front.png", results)
    for name, text in all_tables(report).items():
        console.print(f"\n{name}\n", style="bold")
        print(text)
    console.print(f"\nwritten: {arguments.out / 'bench.json'}, {arguments.out / 'front.png'}")
    return 1 if failures else 0


def _joints() -> list[dict[str, float | str]]:
    ours = [
        simulated_joint("tensile_curve", Policy.RELATIVE),
        simulated_joint("tensile_curve", Policy.ENERGY),
        simulated_joint("tensile", Policy.ENERGY),
    ]
    return [asdict(joint) for joint in (*PAPER, exact_joint(Law.CURVE), exact_joint(Law.OGDEN), *ours)]


def _draw(path: Path, results: list[PeerResult]) -> None:
    from gdfe_ros.benchmark.front_picture import draw_front

    draw_front(path, results)
