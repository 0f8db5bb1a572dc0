# SPDX-License-Identifier: Apache-2.0
"""No table in the pages is of a solver that does otherwise than this one."""

from __future__ import annotations

from unittest.mock import patch

import pytest

from benchmarks import second_level
from benchmarks.measure.tables import NAMES, TABLES, Table
from benchmarks.provenance import stamp
from benchmarks.report import KEPT, Report, read_report
from docs.scripts import generate
from gdfe_ros.solver.equilibrium import slender

OLDER: dict[str, str] = {}
"""Tables whose pages say that an older solver made them, and why. One that is measured must leave this list."""


def _current(table: Table) -> object:
    reason = OLDER.get(table.name)
    return pytest.param(table, id=table.name, marks=[pytest.mark.xfail(reason=reason, strict=True)] if reason else [])


@pytest.mark.parametrize("table", [_current(table) for table in TABLES])
def test_a_table_is_of_a_solver_like_this_one(table: Table) -> None:
    """Replay a small part of a table: no figure is off by more than a tenth (remedy: make measure, make docs)."""
    if absent := table.missing():
        pytest.skip(f"not installed: {', '.join(absent)}")
    stale = read_report(table.file).stale(table.replay())
    assert not stale, f"{table.name} is stale: make measure ONLY={table.name}\n" + "\n".join(stale)


def test_every_printed_table_is_measured_by_the_one_command() -> None:
    """Compare the files in test/data with those that are printed, and with those that are measured."""
    kept = sorted(path.stem for path in KEPT.glob("*.json"))
    assert sorted(NAMES) == kept
    assert sorted(generate.TABLES) == kept


def test_a_solver_that_does_otherwise_is_seen() -> None:
    """Replay slender streams without the kept tangent: what they take together is stale, and nothing with it."""
    kept = Report([], stamp(), second_level.probe())
    assert kept.stale(second_level.probe()) == []
    with patch.object(slender, "SLENDER", 0.0):
        stale = kept.stale(second_level.probe())
    assert "iterations of all" in {text.partition(":")[0] for text in stale}
