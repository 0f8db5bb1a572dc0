# SPDX-License-Identifier: Apache-2.0
"""The table of factors in a band and by supernodes."""

from __future__ import annotations

from benchmarks import factors


def test_both_kinds_are_measured() -> None:
    """Measure the finger: by supernodes less is filled, and that is what is taken and marked."""
    (row,) = factors.rows(1, ("tendon_finger",))
    assert row["taken"] == "Fronts"
    assert row["entries"][1] < 0.5 * row["entries"][0]
    *_, factor_time, _, solve_time, end = factors.table([row]).splitlines()[-1].split("|")
    assert end == ""
    assert "**" in factor_time
    assert "**" in solve_time
