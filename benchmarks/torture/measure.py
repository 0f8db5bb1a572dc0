# SPDX-License-Identifier: Apache-2.0
"""The torture test as a table: ``python -m benchmarks.torture.measure [--out FILE]`` runs it, keeps it and draws it."""

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
"""Cases of each group in the probe: the first so many of those that take least. The third mesh, a sliver, takes 234 or
274 iterations, as the processor rounds."""


def probed() -> list[Case]:
    """Return the cases of the probe: the first few of the groups that take least."""
    cases = all_cases(walk_steps=100)
    return [case for group, count in PROBED.items() for case in [item for item in cases if item.group is group][:count]]


def probe() -> dict[str, float | str]:
    """Return verdicts of some cheap cases, and the iterations of all of a group that converge, together.

    A case that is reported looks for an equilibrium that does not exist: rounding decides how long.
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
    """Run every case on all cores; return 1 where one failed, and write nothing where one is missing."""
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
