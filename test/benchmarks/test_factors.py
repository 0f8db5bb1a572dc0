# SPDX-License-Identifier: Apache-2.0
"""The table of factors as LAPACK's band and as supernodes."""

from __future__ import annotations

from benchmarks import factors


def test_both_kinds_are_measured() -> None:
    """For the finger, supernodes have less than half of the band's entries, and all times are positive."""
    (row,) = factors.rows(1, ("tendon_finger",))
    assert row["entries"][1] < 0.5 * row["entries"][0]
    assert min(*row["factor"], *row["solve"]) > 0.0
    assert factors.table([row]).splitlines()[-1].count("|") == len(factors.HEADINGS) + 1
