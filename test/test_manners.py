# SPDX-License-Identifier: Apache-2.0
"""The table of manners in the pages: of the questions that ``make manners`` asks today, and without a difference."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

from benchmarks.report import KEPT, read_report

ROOT = Path(__file__).parents[1]


def _script() -> ModuleType:
    """Read the script; what it asks is imported only when it runs."""
    spec = importlib.util.spec_from_file_location("manners", ROOT / "test" / "manners" / "__main__.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_table_is_of_these_questions() -> None:
    """Compare the mark of the questions; where it differs: make measure ONLY=manners."""
    report = read_report(KEPT / "manners.json").data
    assert report["questions"] == _script().questions()


def test_nothing_was_found_that_was_not_expected() -> None:
    """Compare the columns of the table."""
    rows = read_report(KEPT / "manners.json").data["rows"]
    assert [(asked, expected, found) for _, asked, expected, found in rows if expected != found] == []
    assert len({group for group, *_ in rows}) == 20
