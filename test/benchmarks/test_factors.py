# SPDX-License-Identifier: Apache-2.0
"""The table of factors in LAPACK's band and in fronts."""

from __future__ import annotations

from benchmarks import factors


def test_both_kinds_are_measured() -> None:
    """Measure the finger: fronts fill less, and both solve and factor in some time."""
    (row,) = factors.rows(1, ("tendon_finger",))
    assert row["entries"][1] < 0.5 * row["entries"][0]
    assert min(*row["factor"], *row["solve"]) > 0.0
    assert factors.table([row]).splitlines()[-1].count("|") == len(factors.HEADINGS) + 1
