# SPDX-License-Identifier: Apache-2.0
"""Streams of small steps: how many a second, and how far from the reference where they end.

``python -m benchmarks.streams [DIRECTORY]`` plays every solver that can on several meshes, writes ``streams.json`` into
the directory (default: runs/streams) and prints the tables of docs/benchmark.md: every stream, and each solver's
fastest one within a limit of error, whatever its mesh. A peer that lags behind its handle ends off the reference.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.cold import Job, jobs, run_jobs
from benchmarks.markdown import markdown_table
from benchmarks.peers.peer import PeerError, PeerResult, Solver
from benchmarks.tables import NAMES, front_rows

REPEATS = 3
SOLVERS = (Solver.GDFE, Solver.MUJOCO)
"""Those that make steps of their own."""
LIMITS = (2.0, 1.0, 0.75, 0.5, 0.35)
"""Errors at the end [%]."""


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return both tables of a streams.json by name."""
    results = [PeerResult.from_json(item) for item in report["results"]]
    return {"streaming": stream_table(results), "stream front": front_table(results)}


def steps_a_second(result: PeerResult) -> float:
    """Return the rate of a stream [1/s]."""
    return result.settings["steps"] / result.time_solve


def stream_table(results: Sequence[PeerResult]) -> str:
    """Return steps a second, times of a step and errors of every stream."""
    rows = []
    for result in sorted(results, key=lambda item: (item.scene, -steps_a_second(item))):
        p50, p99 = result.settings["step_time_p50"], result.settings["step_time_p99"]
        error = result.settings.get("path_error")
        rows.append(
            (result.scene, f"{NAMES[result.solver]} {result.mesh}", str(result.settings["steps"]),
             f"{steps_a_second(result):.0f}", f"{1e3 * p50:.2f}", f"{1e3 * p99:.2f}",
             f"{100 * result.mean_error:.3f}", "" if error is None else f"{100 * error:.3f}")
        )  # fmt: skip
    heads = ("scene", "solver", "steps", "steps/s", "p50 [ms]", "p99 [ms]", "error at the end [%]", "of the path [%]")
    return markdown_table(heads, rows)


def front_table(results: Sequence[PeerResult]) -> str:
    """Return each solver's fastest stream, of as many steps each, on any mesh within a limit of error at its end."""
    rows = front_rows(results, SOLVERS, LIMITS, lambda item: f"{steps_a_second(item):.0f}")
    heads = ("scene", "error at the end at most [%]", *(f"{NAMES[solver]}, steps/s" for solver in SOLVERS))
    return markdown_table(heads, rows)


def main(out: Path) -> int:
    """Measure, write and print; return 1 where a run failed."""
    failures: list[str] = []

    def done(job: Job, outcome: PeerResult | PeerError) -> None:
        where = f"{job.solver.value} {job.case.name.value} {job.variant.label}"
        if isinstance(outcome, PeerError):
            failures.append(str(outcome))
            print(f"{where}: {outcome}", file=sys.stderr)
        else:
            print(f"{where}: {steps_a_second(outcome):.0f} steps/s", file=sys.stderr)

    results = run_jobs(jobs(slow=True, threads=1, streams=True), repeats=REPEATS, done=done)
    report = {"results": [result.to_json() for result in results], "failures": failures}
    out.mkdir(parents=True, exist_ok=True)
    (out / "streams.json").write_text(json.dumps(report, indent=1))
    for text in all_tables(report).values():
        print(text)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/streams")))
