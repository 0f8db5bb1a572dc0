# SPDX-License-Identifier: Apache-2.0
"""Tests of Newton, MuJoCo and SOFA, by the rules of their authors.

``python -m benchmarks.public_cases`` prints the table of docs/public_cases.md (a minute).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from benchmarks.markdown import markdown_table
from benchmarks.public_cases import Row
from benchmarks.public_cases.mujoco_tests import mujoco_rows
from benchmarks.public_cases.newton_tests import newton_rows
from benchmarks.public_cases.sofa_tests import sofa_rows
from benchmarks.report import options, write_report

REPOSITORIES = {
    "Newton": "https://github.com/newton-physics/newton",
    "MuJoCo": "https://github.com/google-deepmind/mujoco",
    "SOFA": "https://github.com/sofa-framework/sofa",
}


def case_table(report: Sequence[Mapping[str, Any]]) -> str:
    """Return the table: a row for each test, with source, rule, figure, and whether the rule holds."""
    rows = []
    for each in (Row(**item) for item in report):
        project, name = each.source.split(", ")
        source = f"{project}, [{name}]({REPOSITORIES[project]}/blob/{each.revision}/{each.path})"
        rows.append([source, each.body, each.rule, each.figure, "yes" if each.holds else "**no**"])
    return markdown_table(("test", "body", "rule", "here", "holds"), rows)


def probe() -> dict[str, float]:
    """Return the extension of the hanging beam [m], and the change of volume of the stretched one."""
    rows = {row.source: row.value for row in newton_rows()[:3]}
    return {"extension": rows["Newton, soft_beam_extension"], "volume": rows["Newton, soft_beam_stretch"]}


def main() -> int:
    """Run all tests, write the report, and print the table."""
    given = options("benchmarks.public_cases", "Tests of other simulators by their rules.", "public_cases").parse_args()
    report = [asdict(row) for row in (*newton_rows(), *mujoco_rows(), *sofa_rows())]
    write_report(given.out, report, probe())
    print(case_table(report))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
