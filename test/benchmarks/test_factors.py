# SPDX-License-Identifier: Apache-2.0
"""The table of factors in a band and by supernodes."""

from __future__ import annotations

import pytest

from benchmarks import factors
from benchmarks.robots import ROBOTS


def test_both_kinds_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure the finger: by supernodes less is filled, and that is what is taken and marked."""
    monkeypatch.setattr(factors, "REPEATS", 1)
    monkeypatch.setattr(factors, "ROBOTS", [robot for robot in ROBOTS if robot.scene == "tendon_finger"])
    (row,) = factors.rows()
    assert row["taken"] == "Fronts"
    assert row["entries"][1] < 0.5 * row["entries"][0]
    *_, factor_time, _, solve_time, end = factors.table([row]).splitlines()[-1].split("|")
    assert end == ""
    assert "**" in factor_time
    assert "**" in solve_time
