# SPDX-License-Identifier: Apache-2.0
"""Texts in README and docs/ that are printed from the code and from the stored reports, between marks.

``python -m docs.scripts.generate`` writes them into the pages; ``make docs`` runs it before it builds the pages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from benchmarks import contact, environments, motion, robots, streams
from benchmarks.elasticity import table as elasticity
from benchmarks.loop import table as loop_tables
from benchmarks.markdown import markdown_table, replace_tables
from benchmarks.measured_robots import afternoon, arm_steps, membrane, module, rubber
from benchmarks.node import latency
from benchmarks.public_cases.__main__ import case_table
from benchmarks.report import KEPT, read_report
from benchmarks.tables import all_tables
from benchmarks.torture.score import torture_table
from docs.scripts import node_reference, scene_reference
from docs.scripts.compatibility import compatibility_table
from docs.scripts.library import library_table, published_table

ROOT = Path(__file__).resolve().parents[2]


def pages() -> list[Path]:
    """Return the paths of README and of every page of docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def texts() -> dict[str, str]:
    """Return dict from the name in the marks to the text that is printed there; tables end with their provenance."""
    found = {
        "scene": scene_reference.markdown(),
        "modes": scene_reference.mode_table(),
        "node": node_reference.markdown(),
        "library": library_table(),
        "published": published_table(),
        "compatibility": compatibility_table(),
    }
    for name, tables in TABLES.items():
        report = read_report(KEPT / f"{name}.json")
        printed = tables(report.data)
        printed = {name: printed} if isinstance(printed, str) else printed
        found |= {mark: f"{text.strip()}\n\n{report.made.line}" for mark, text in printed.items()}
    return {name: text.strip() for name, text in found.items()}


def manners_table(report: Mapping[str, Any]) -> str:
    """Return a table for each group of checks of a node from outside: check, expected result and result."""
    parts = []
    for group, rows in groupby(report["rows"], key=lambda row: row[0]):
        table = markdown_table(("asked", "expected", "found"), [[f"{cell}" for cell in row[1:]] for row in rows])
        parts.append(f"### {group.capitalize()}\n\n{table}")
    return "\n\n".join(parts)


TABLES: dict[str, Callable[[Any], Mapping[str, str] | str]] = {
    "afternoon": afternoon.form_table,
    "bench": all_tables,
    "bench_node": latency.latency_table,
    "contact": contact.all_tables,
    "elasticity": elasticity.size_table,
    "environments": environments.environment_table,
    "loop": loop_tables.make_loop_table,
    "manners": manners_table,
    "measured_arm_steps": arm_steps.step_tables,
    "measured_membrane": membrane.membrane_table,
    "measured_module": module.module_table,
    "measured_rubber": rubber.rubber_table,
    "motion": motion.all_tables,
    "public_cases": case_table,
    "robots": robots.robot_table,
    "streams": streams.all_tables,
    "torture": torture_table,
}
"""Dict from file in `KEPT` to the function that returns its table, or a dict from table name to table."""


def main() -> None:
    """Write every page that is not up to date, and print its name."""
    printed = texts()
    for page in pages():
        text = page.read_text(encoding="utf-8")
        filled = replace_tables(text, printed)
        if filled != text:
            page.write_text(filled, encoding="utf-8")
            print(f"written: {page.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
