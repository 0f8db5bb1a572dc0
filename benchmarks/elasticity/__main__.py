# SPDX-License-Identifier: Apache-2.0
"""The elasticity benchmark: ``python -m benchmarks.elasticity`` measures all rows, and prints the table."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from benchmarks.elasticity import felupe_rows, newton, own
from benchmarks.elasticity.problem import LEVELS, OWN, PROBLEMS, Problem, errors, levels
from benchmarks.elasticity.table import size_table
from benchmarks.report import KEPT, run_script

REFERENCE = KEPT / "reference" / "elasticity.json"
Rows = dict[str, Callable[[Problem, int], dict[str, Any]]]
ROWS: Rows = {
    "gdfe_ros, tetrahedra": partial(own.solve, tetrahedra=True),
    "gdfe_ros, hexahedra": lambda problem, n: own.solve(problem, 2 * n, tetrahedra=False),
    "Newton, P2": partial(newton.solve, order=2),
    "Newton, P1": lambda problem, n: newton.solve(problem, 2 * n, order=1),
    "FElupe, H27": partial(felupe_rows.solve, order=2),
    "FElupe, H8": lambda problem, n: felupe_rows.solve(problem, 2 * n, order=1),
}
"""Dict from the name of a row to the function that solves a problem with nodes at 2 n intervals along each edge."""


def measure(rows: Rows, problems: Sequence[Problem], most: int) -> list[dict[str, Any]]:
    """Return the runs of all rows (`problem.run`) on meshes up to level ``most``, with the name of their row."""
    runs = []
    for name, solve in rows.items():
        solve(max(problems, key=lambda each: each.ratio), min(LEVELS))  # this and the next compile and load libraries
        solve(problems[0], levels(problems[0], name, most)[-1])
        for problem in problems:
            for n in levels(problem, name, most):
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", RuntimeWarning)  # of numpy in solves that diverge, which fail
                    runs.append({"row": name, **solve(problem, n)})
                print(".", end="", flush=True)
    print()
    return runs


def compare(runs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the runs with their errors against the reference (`problem.errors`) instead of their displacements."""
    known = json.loads(REFERENCE.read_text(encoding="utf-8"))
    return [
        {key: value for key, value in run.items() if key not in ("displacement", "reaction")}
        | (errors(run, known[run["problem"]]) if not run["message"] else {})
        for run in runs
    ]


def probe() -> dict[str, float]:
    """Return errors and iterations of this solver on the coarser meshes."""
    ours = {name: solve for name, solve in ROWS.items() if name.startswith(OWN)}
    found: dict[str, float] = {}
    for run in compare(measure(ours, (PROBLEMS[0], PROBLEMS[4], PROBLEMS[-3]), 4)):
        key = f"{run['row']}, {run['problem']}, {run['unknowns']}"
        found |= {f"{key}: error": run["error"], f"{key}: iterations": run["iterations"]}
    return found


if __name__ == "__main__":
    run_script(
        "benchmarks.elasticity",
        "Elasticity by the rules of a public benchmark.",
        "elasticity",
        measure=lambda: compare(measure(ROWS, PROBLEMS, max(LEVELS))),
        tables=size_table,
        probe=probe,
    )
