# SPDX-License-Identifier: Apache-2.0
"""The torture test as a table: ``python -m benchmarks.torture.measure [--out FILE] [--workers N]``."""

from __future__ import annotations

from benchmarks.report import options, write_report
from benchmarks.torture.case import Case, Group, Verdict, attempt
from benchmarks.torture.catalogue import all_cases
from benchmarks.torture.score import Score, run_case, torture_table
from gdfe_ros.analysis.workers import connect, run_tasks
from gdfe_ros.commands.options import add_workers
from gdfe_ros.commands.waiting import progress_bar

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


def main() -> int:
    """Run all cases, write the report and print the table; return 1 if a case failed.

    If a case raises an error that the package does not raise on purpose, nothing is written.
    """
    parser = options("benchmarks.torture.measure", "The torture test.", "torture")
    add_workers(parser)
    given, names = parser.parse_args(), [case.id for case in all_cases()]
    found: dict[int, Score] = {}
    with connect(given.scheduler, given.workers) as client, progress_bar("cases", len(names), counted=True) as update:
        for number, score, error in run_tasks(client, run_case, names):
            if error is not None:
                raise error
            found[number] = score
            update(completed=len(found))
    scores = [found[number] for number in range(len(names))]
    write_report(given.out, scores, probe())
    print(torture_table(scores)["torture"])
    failed = [score for score in scores if score["verdict"] == Verdict.FAILED.value]
    for score in failed:
        print(f"{score['group']}, {score['name']}, {score['law']}, {score['policy']}: {score['text']}")
    return int(bool(failed))


if __name__ == "__main__":
    raise SystemExit(main())
