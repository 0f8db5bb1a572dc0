# SPDX-License-Identifier: Apache-2.0
"""What README and the pages of docs/ have from the code and from the kept reports, put between its marks.

``python -m docs.scripts.generate`` writes it; ``make docs`` does that before it builds the pages.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from benchmarks import batches, constant_factors, contact, cut_cells, factors, motion, second_level, streams
from benchmarks.coarse_meshes import table as coarse_meshes
from benchmarks.markdown import markdown_table, replace_tables
from benchmarks.node import tables as node_tables
from benchmarks.tables import all_tables, tables_beside
from docs.scripts.constants import constant_table
from gdfe_ros.node import reference as node_reference
from gdfe_ros.scene import reference as scene_reference

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "test" / "data"
"""Reports of ``make bench``, ``bench-node``, ``bench-skip``, ``bench-motion``, ``bench-contact``, ``manners`` and
``torture``, copied from runs/."""


def pages() -> list[Path]:
    """Return README and every page of docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def texts() -> dict[str, str]:
    """Return everything that is printed into pages, by the name in its marks."""
    found = {
        "scene": scene_reference.markdown(),
        "node": node_reference.markdown(),
        "constants": constant_table(),
        "batches": batches.batch_table(json.loads((DATA / "batches.json").read_text())),
        "constant factors": constant_factors.table(json.loads((DATA / "constant_factors.json").read_text())),
        "factors": factors.table(json.loads((DATA / "factors.json").read_text())),
        "robots_level": second_level.table(json.loads((DATA / "robots_level.json").read_text())["rows"]),
        "second_level": second_level.table(json.loads((DATA / "second_level.json").read_text())["rows"]),
        "manners": manners_table(json.loads((DATA / "manners.json").read_text())),
        **tables_beside(DATA / "bench.json"),
        **node_tables.all_tables(json.loads((DATA / "bench_node.json").read_text())),
    }
    found |= motion.all_tables(json.loads((DATA / "motion.json").read_text()))
    found |= contact.all_tables(json.loads((DATA / "contact.json").read_text()))
    found |= coarse_meshes.all_tables(json.loads((DATA / "coarse_meshes.json").read_text()))
    found |= streams.all_tables(json.loads((DATA / "streams.json").read_text()))
    found |= cut_cells.all_tables(json.loads((DATA / "cut_cells.json").read_text()))
    for name in ("bench", "skip", "torture"):
        found |= all_tables(json.loads((DATA / f"{name}.json").read_text()))
    return {name: text.strip() for name, text in found.items()}


def manners_table(report: Mapping[str, Any]) -> str:
    """Return what was asked of a node from outside, expected and found, a table for each group of questions."""
    parts = []
    for group, rows in groupby(report["rows"], key=lambda row: row[0]):
        table = markdown_table(("asked", "expected", "found"), [[f"{cell}" for cell in row[1:]] for row in rows])
        parts.append(f"### {group.capitalize()}\n\n{table}")
    return "\n\n".join(parts)


def main() -> None:
    """Write every page anew that is not up to date, and name it."""
    printed = texts()
    for page in pages():
        text = page.read_text(encoding="utf-8")
        filled = replace_tables(text, printed)
        if filled != text:
            page.write_text(filled, encoding="utf-8")
            print(f"written: {page.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
