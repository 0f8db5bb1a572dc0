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
from benchmarks.report import run_script

REPOSITORIES = {
    "Newton": "https://github.com/newton-physics/newton",
    "MuJoCo": "https://github.com/google-deepmind/mujoco",
    "SOFA": "https://github.com/sofa-framework/sofa",
}


def measure() -> list[dict[str, Any]]:
    """Run all tests, and return their rows."""
    return [asdict(row) for row in (*newton_rows(), *mujoco_rows(), *sofa_rows())]


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


if __name__ == "__main__":
    run_script(
        "benchmarks.public_cases",
        "Tests of other simulators by their rules.",
        "public_cases",
        measure=measure,
        tables=case_table,
        probe=probe,
    )
