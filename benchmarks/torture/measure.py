# SPDX-License-Identifier: Apache-2.0
"""The torture test as a table: ``python -m benchmarks.torture.measure [--out FILE]`` runs all cases on all cores."""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context

from benchmarks.report import options, write_report
from benchmarks.torture.case import Case, Group, Verdict, attempt
from benchmarks.torture.catalogue import all_cases
from benchmarks.torture.score import Score, score_of, torture_table

PROBED = {Group.CONTRASTS: 5, Group.SCALES: 5, Group.MESHES: 2, Group.LAWS: 4, Group.ACTUATORS: 2, Group.HONESTY: 1}
"""Dict from group to the number of its first cases that the probe runs, for the groups that need least time. The third
mesh, a sliver, is left out, because it needs 234 or 274 iterations, depending on the processor's rounding."""


def probed() -> list[Case]:
    """Return the cases of the probe: the first cases of the groups that need least time."""
    cases = all_cases(walk_steps=100)
    return [case for group, count in PROBED.items() for case in [item for item in cases if item.group is group][:count]]


def probe() -> dict[str, float | str]:
    """Return the verdicts of some cheap cases, and the sum of iterations of each group's converged cases.

    Iterations of reported cases are left out: the solver searches an equilibrium that does not exist, and their number
    depends on rounding.
    """
    found: dict[str, float | str] = {}
    for case in probed():
        outcome = attempt(case)
        found[f"{case.id}: verdict"] = outcome.verdict.value
        if outcome.verdict is Verdict.CONVERGED:
            name = f"{case.group.value}: iterations"
            found[name] = float(found.get(name, 0.0)) + outcome.iterations
    return found


def run(name: str) -> Score:
    """Run the case with an id, in any process, and return its score."""
    case = _catalogue()[name]
    return score_of(case, attempt(case))


@cache
def _catalogue() -> dict[str, Case]:
    return {case.id: case for case in all_cases()}


def main() -> int:
    """Run all cases, write the report and print the table; return 1 if a case failed.

    If a case raises an error that the package does not raise on purpose, nothing is written.
    """
    given = options("benchmarks.torture.measure", "The torture test.", "torture").parse_args()
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        scores = list(pool.map(run, _catalogue()))
    write_report(given.out, scores, probe())
    print(torture_table(scores)["torture"])
    failed = [score for score in scores if score["verdict"] == Verdict.FAILED.value]
    for score in failed:
        print(f"{score['group']}, {score['name']}, {score['law']}, {score['policy']}: {score['text']}")
    return int(bool(failed))


if __name__ == "__main__":
    raise SystemExit(main())
