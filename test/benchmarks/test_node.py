# SPDX-License-Identifier: Apache-2.0
"""The node's benchmark in small: a real process, consistent figures, and its table."""

from __future__ import annotations

from dataclasses import asdict

import pytest

from benchmarks.markdown import MARK, replace_tables
from benchmarks.node import latency


def test_a_command_takes_longer_than_its_solve() -> None:
    """In 20 round trips, the medians are below the percentiles, and the solve is shorter than the whole."""
    found = latency.measure(500, steps=20)
    assert 0.0 < found.solve_p50 < found.p50 <= found.p99
    assert found.solve_p50 <= found.solve_p99


def test_a_table_takes_its_place_in_a_page() -> None:
    """A table between its marks has the figures of the report, and the text around it stays."""
    tables = latency.latency_table([asdict(latency.Latency(1250, 300, 2.0, 4.0, 1.5, 3.0))])
    assert tables["latency"].splitlines()[-1] == "| 1250 | 2.00 | 4.00 | 1.50 | 3.00 |"
    start = MARK.format(name="latency")
    text = f"before\n{start}\nold\n<!-- end latency -->\nafter"
    assert replace_tables(text, tables) == f"before\n{start}\n{tables['latency']}\n<!-- end latency -->\nafter"


def test_a_mark_that_nothing_is_printed_for_is_named() -> None:
    """An unknown table and a missing end mark are refused by name."""
    with pytest.raises(ValueError, match=r"'tides'.*there is: idle"):
        replace_tables(MARK.format(name="tides") + "\n<!-- end tides -->", {"idle": ""})
    with pytest.raises(ValueError, match="'idle'"):
        replace_tables(MARK.format(name="idle"), {"idle": ""})
