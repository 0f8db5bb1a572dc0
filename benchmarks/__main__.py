# SPDX-License-Identifier: Apache-2.0
"""``make bench``: run time against error, compared with FElupe, CalculiX and MuJoCo; and scaling with size."""

from __future__ import annotations

import sys

from rich.console import Console

from benchmarks.cases import CaseName, get_case
from benchmarks.cold import Job, jobs, missing, run_jobs
from benchmarks.front_picture import draw_fronts
from benchmarks.peers import gdfe_peer
from benchmarks.peers.peer import PeerError, PeerResult
from benchmarks.references import load_reference, measure_error
from benchmarks.replay import summed
from benchmarks.report import options, write_report
from benchmarks.scaling import SIZES, measure_size, scaling_probe
from benchmarks.tables import all_tables


def main() -> int:
    """Run all measurements, write bench.json and the picture, print the tables; return 1 if a run failed."""
    parser = options("benchmarks", "Run time against error beside FElupe, CalculiX and MuJoCo; scaling.", "bench")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each kind; the median counts (default: 3)")
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

    results = run_jobs(jobs(), repeats=arguments.repeats, done=done)
    report = {
        "missing": missing(),
        "failures": failures,
        "results": [result.to_json() for result in results],
        "scaling": [measure_size(cells) for cells in SIZES],
    }
    write_report(arguments.out, report, probe())
    picture = (arguments.pictures or arguments.out.parent) / "front.png"
    draw_fronts(picture, results)
    for name, text in all_tables(report).items():
        console.print(f"\n{name}\n", style="bold")
        print(text)
    console.print(f"\nwritten: {arguments.out}, {picture}")
    return 1 if failures else 0


def probe() -> dict[str, float]:
    """Return figures of cold solves: every scene on our coarsest mesh and on the paper's, and the first of `SIZES`."""
    found = scaling_probe()
    for name in CaseName:
        case, reference = get_case(name), load_reference(name)
        cold = [item for item in gdfe_peer.variants(case) if item.steps == 1]
        smallest = min(item.cells for item in cold)
        for variant in [item for item in cold if item.cells in (smallest, case.cells)]:
            solution = gdfe_peer.solve(case, variant, reference.vertices)
            label = f"{name.value} {variant.label}"
            found[f"{label}: iterations"] = solution.settings["iterations"]
            found[f"{label}: error"] = measure_error(solution.displacement, reference.displacement).mean
    return summed(found)


if __name__ == "__main__":
    sys.exit(main())
