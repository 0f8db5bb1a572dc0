# SPDX-License-Identifier: Apache-2.0
"""The torture test as a table: ``python -m benchmarks.torture.measure [--out FILE]`` runs, stores and draws it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from benchmarks.provenance import ROOT
from benchmarks.report import options, write_report
from benchmarks.torture.case import Case, Group, Verdict, attempt
from benchmarks.torture.catalogue import all_cases
from benchmarks.torture.picture import draw_scores
from benchmarks.torture.score import read_scores

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
    """Run all cases on all cores; return 1 if a case failed. If a case has no outcome, nothing is written."""
    parser = options("benchmarks.torture.measure", "The torture test.", "torture")
    parser.add_argument("--quick", action="store_true", help="only the contrasts, for runs/")
    given = parser.parse_args()
    folder = Path("runs", "torture").resolve()
    kept = folder / "torture.json"
    kept.unlink(missing_ok=True)
    command = [sys.executable, "-m", "pytest", "-q", "-m", "torture", "-n", str(os.cpu_count() or 1), "--no-header"]
    command += ["-k", "contrasts"] if given.quick else []
    environment = {**os.environ, "TORTURE_OUTPUT": str(folder)}
    status = subprocess.run([*command, "test/torture/test_cases.py"], cwd=ROOT, env=environment, check=False).returncode
    scores = read_scores(kept) if kept.is_file() else []
    missing = len(all_cases()) - len(scores)
    if not scores or (missing and not given.quick):
        print(f"{missing} cases have no outcome; nothing is written", file=sys.stderr)
        return 1
    write_report(given.out, json.loads(kept.read_text(encoding="utf-8")), probe())
    draw_scores((given.pictures or given.out.parent) / "torture.png", scores)
    return status


if __name__ == "__main__":
    sys.exit(main())
