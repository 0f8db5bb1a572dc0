# SPDX-License-Identifier: Apache-2.0
"""The tables of the node's benchmark, and its check of targets."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from benchmarks.markdown import MARK, replace_tables
from benchmarks.node import since
from benchmarks.node.__main__ import missed_targets
from benchmarks.node.cost import Cost
from benchmarks.node.flood import Flood
from benchmarks.node.idle import Idleness
from benchmarks.node.latency import Latency
from benchmarks.node.lockstep import Lockstep
from benchmarks.node.tables import all_rows, all_tables

LATENCY = Latency(1250, 300, 2.0, 4.0, 1.5, 3.0)
BARE = Cost(1250, False, False, 2.2, 2.0, 1.9, 0.2, {"gdfe-courier": 0.04, "python": 0.01})
FULL = Cost(1250, True, True, 2.4, 2.1, 1.9, 0.3, {"gdfe-courier": 0.5})
IDLE = Idleness("wall, paused", 20.0, 0.002, 0, 20.0)
STEPS = Lockstep(5000, 5000, 10.0)
FLOOD = Flood("handles", 1000, 1000, {"stale": 1000}, 0.5, True, 0.0, 1000, 0)


def _report() -> dict[str, Any]:
    items = {"latency": [LATENCY], "cost": [BARE, FULL], "idle": [IDLE], "floods": [FLOOD]}
    report = {name: [dataclasses.asdict(item) for item in found] for name, found in items.items()}
    return {**report, "lockstep": dataclasses.asdict(STEPS)}


def test_tables_hold_the_figures() -> None:
    """The printed tables of a report have the right fractions, sums and rates."""
    rows = {name: rows for name, (_, rows) in all_rows(_report()).items()}
    assert rows["latency"] == [("1250", "2.00", "4.00", "1.50", "3.00")]
    assert rows["node cost"][1] == ("1250", "mesh, strain", "yes", "2.40", "2.10", "1.90", "0.30", "12.5", "0.50")
    assert rows["idle"] == [("wall, paused", "0.20", "20 s", "0")]
    assert rows["commands"][1] == ("bad, handles", "1000", "0", "1000", "2000", "yes", "0.0")


def test_tables_take_their_place_in_a_readme() -> None:
    """A table between its marks is replaced, and the text around it stays."""
    start = MARK.format(name="idle")
    text = f"before\n{start}\nold\n<!-- end idle -->\nafter"
    tables = all_tables(_report())
    assert replace_tables(text, tables) == f"before\n{start}\n{tables['idle']}\n<!-- end idle -->\nafter"


def test_a_mark_that_nothing_is_printed_for_is_named() -> None:
    """An unknown table and a missing end mark are refused by name."""
    with pytest.raises(ValueError, match=r"'tides'.*there is: idle"):
        replace_tables(MARK.format(name="tides") + "\n<!-- end tides -->", {"idle": ""})
    with pytest.raises(ValueError, match="'idle'"):
        replace_tables(MARK.format(name="idle"), {"idle": ""})


def test_targets_that_are_met_are_not_missed() -> None:
    """A report that meets all targets gives no message."""
    assert missed_targets([BARE, FULL], [IDLE], STEPS, [FLOOD]) == []


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"costs": [dataclasses.replace(BARE, delay=0.31)]}, "nobody listens"),
        ({"costs": [dataclasses.replace(FULL, delay=0.37)]}, "recorded"),
        ({"idles": [dataclasses.replace(IDLE, share=0.011)]}, "1.10% of a core"),
        ({"steps": dataclasses.replace(STEPS, consumed=4999)}, "1 commands lost"),
        ({"floods": [dataclasses.replace(FLOOD, refused=999)]}, "bad commands"),
        ({"floods": [dataclasses.replace(FLOOD, finite=False)]}, "bad commands"),
        ({"floods": [dataclasses.replace(FLOOD, memory=5_000_000)]}, "bad commands"),
        ({"floods": [dataclasses.replace(FLOOD, status=-11)]}, "bad commands"),
    ],
)
def test_a_target_that_is_missed_is_named(changed: dict[str, Any], text: str) -> None:
    """A report that misses one target names that target only."""
    report = {"costs": [BARE, FULL], "idles": [IDLE], "steps": STEPS, "floods": [FLOOD], **changed}
    (found,) = missed_targets(*report.values())
    assert text in found


def test_figures_of_two_trees_stand_beside_each_other() -> None:
    """The table of two trees has the medians of three rounds each, and of their ratios."""
    rounds = {"before": [{"p50 [ms]": value} for value in (3.0, 1.0, 2.0)], "now": [{"p50 [ms]": 1.5}] * 3}
    rounds["ratio"] = [{"p50 [ms]": value} for value in (0.5, 1.5, 0.76)]
    assert since.table(rounds).splitlines()[2] == "| p50 [ms] | 2 | 1.5 | 0.76 |"
