# SPDX-License-Identifier: Apache-2.0
"""``make bench``: run time against error beside FElupe, CalculiX and MuJoCo; scaling."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from benchmarks.cold import Job, jobs, missing, run_jobs
from benchmarks.peers.peer import PeerError, PeerResult
from benchmarks.scaling import measure_ratios, measure_scaling
from benchmarks.series import PAPER, exact_joint, simulated_joint
from benchmarks.tables import all_tables
from gdfe_ros.materials import Law
from gdfe_ros.solver.settings import Policy


def main() -> int:
    """Measure, write bench.json and the picture, print the tables; return 1 where a run failed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/bench"), help="directory of bench.json and the picture")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each kind; the median counts (default: 3)")
    parser.add_argument("--quick", action="store_true", help="leave out runs of more than ten seconds")
    arguments = parser.parse_args()
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
    from benchmarks.front_picture import draw_front

    draw_front(path, results)


if __name__ == "__main__":
    sys.exit(main())
