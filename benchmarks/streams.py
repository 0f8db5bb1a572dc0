# SPDX-License-Identifier: Apache-2.0
"""Streams of small steps: rate of the steps, and error of the final state.

``python -m benchmarks.streams [--out FILE]`` runs every solver that can make such steps on several meshes, and prints
the table of docs/benchmark.md: each solver's fastest stream within a limit of error, on any mesh. A peer whose body
lags behind its handle has a large final error.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from benchmarks.cases import CASES, CaseName
from benchmarks.cold import jobs, missing, run_jobs
from benchmarks.markdown import left_out, markdown_table
from benchmarks.peers import gdfe_peer
from benchmarks.peers.peer import PeerResult, Solver, list_variants
from benchmarks.replay import first_steps
from benchmarks.report import options, write_report
from benchmarks.tables import NAMES, front_rows
from gdfe_ros.simulation import Simulation

REPEATS = 3
SOLVERS = (Solver.GDFE, Solver.MUJOCO)
"""Solvers that can run a stream of steps."""
LIMITS = (2.0, 1.0, 0.75, 0.5, 0.35)
"""Limits of the final error [%]."""


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table, for the data of a streams.json."""
    results = [PeerResult.from_json(item) for item in report["results"]]
    below = left_out(report.get("missing", {}))
    return {"stream front": front_table(results) + below}


def steps_a_second(result: PeerResult) -> float:
    """Return the rate of a stream [1/s]."""
    return result.settings["steps"] / result.time_solve


def front_table(results: Sequence[PeerResult]) -> str:
    """Return the table with each solver's fastest stream on any mesh, for several limits of the final error."""
    rows = front_rows(results, SOLVERS, LIMITS, lambda item: f"{steps_a_second(item):.0f}")
    heads = ("scene", "allowed error at the end [%]", *(f"{NAMES[solver]}, steps/s" for solver in SOLVERS))
    return markdown_table(heads, rows)


def probe() -> dict[str, float]:
    """Return the figures of the first steps of our stream, on every scene's coarsest mesh and on the paper's mesh."""
    found: dict[str, float] = {}
    for name in CaseName:
        case = CASES[name]
        streams = [item for item in list_variants(Solver.GDFE, case) if "stream" in item.options]
        ends = (min(item.cells for item in streams), case.cells) if streams else ()
        for variant in [item for item in streams if item.cells in ends]:
            simulation = Simulation(gdfe_peer.scene_of(name.value, variant))
            found |= first_steps(f"{name.value} {variant.label}", simulation, variant.steps)
    return found


def main() -> int:
    """Run the measurement, write the report and print the tables; return 1 if a run failed."""
    given = options("benchmarks.streams", "Streams of small steps: rate and final error.", "streams").parse_args()
    results, failures = run_jobs(jobs(streams=True), REPEATS, lambda found: f"{steps_a_second(found):.0f} steps/s")
    lacking = {NAMES[Solver(name)]: reason for name, reason in missing().items() if Solver(name) in SOLVERS}
    report = {"results": [asdict(result) for result in results], "failures": failures, "missing": lacking}
    write_report(given.out, report, probe())
    for text in all_tables(report).values():
        print(text)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
