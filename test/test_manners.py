# SPDX-License-Identifier: Apache-2.0
"""The table of manners in the pages has the present questions of ``make manners``, and no unexpected answer."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

from benchmarks.report import KEPT, read_report

ROOT = Path(__file__).parents[1]


def _script() -> ModuleType:
    """Load the script ``make manners`` without running it."""
    spec = importlib.util.spec_from_file_location("manners", ROOT / "test" / "manners" / "__main__.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_table_is_of_these_questions() -> None:
    """The report has the digest of the present questions (remedy: make measure ONLY=manners)."""
    report = read_report(KEPT / "manners.json").data
    assert report["questions"] == _script().questions()


def test_nothing_was_found_that_was_not_expected() -> None:
    """In each row of the report, the found answer is the expected one."""
    rows = read_report(KEPT / "manners.json").data["rows"]
    assert [(asked, expected, found) for _, asked, expected, found in rows if expected != found] == []
    assert len({group for group, *_ in rows}) == 20
