# SPDX-License-Identifier: Apache-2.0
"""``make bench``: run time against error, compared with FElupe, CalculiX and MuJoCo; and scaling with size."""

from __future__ import annotations

import sys
from dataclasses import asdict

from benchmarks.cases import CASES, CaseName
from benchmarks.cold import jobs, missing, run_jobs
from benchmarks.front_picture import draw_fronts
from benchmarks.peers import gdfe_peer
from benchmarks.peers.peer import Solver, list_variants
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
    for name, reason in missing().items():
        print(f"missing: {name}: {reason}", file=sys.stderr)
    results, failures = run_jobs(
        jobs(),
        arguments.repeats,
        lambda found: f"{1e3 * found.time_solve:.1f} ms, {100 * found.mean_error:.3f} %",
    )
    report = {
        "missing": missing(),
        "failures": failures,
        "results": [asdict(result) for result in results],
        "scaling": [measure_size(cells) for cells in SIZES],
    }
    write_report(arguments.out, report, probe())
    draw_fronts((arguments.pictures or arguments.out.parent) / "front.png", results)
    print("\n\n".join(all_tables(report).values()))
    return 1 if failures else 0


def probe() -> dict[str, float]:
    """Return figures of cold solves: every scene on our coarsest mesh and on the paper's, and the first of `SIZES`."""
    found = scaling_probe()
    for name in CaseName:
        case, reference = CASES[name], load_reference(name)
        cold = [item for item in list_variants(Solver.GDFE, case) if item.steps == 1]
        smallest = min(item.cells for item in cold)
        for variant in [item for item in cold if item.cells in (smallest, case.cells)]:
            solution = gdfe_peer.solve(case, variant, reference.vertices)
            label = f"{name.value} {variant.label}"
            found[f"{label}: iterations"] = solution.settings["iterations"]
            found[f"{label}: error"] = measure_error(solution.displacement, reference.displacement).mean
    return summed(found)


if __name__ == "__main__":
    sys.exit(main())
