# SPDX-License-Identifier: Apache-2.0
"""``make bench-loop [COMMIT=b6cf3c23]``: one table of before and after, times in turn and true errors.

Times are processor times of processes with one thread on one core, in turn; ratios are medians of pairs. True errors
are measured on another core meanwhile. Those of the other commit are kept in build/loop, because they do not change.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.loop.compare import make_lines, report_line, time_row
from benchmarks.loop.honest import make_error_rows
from benchmarks.loop.judge import Known, judge_row
from benchmarks.loop.newton import FROZEN
from benchmarks.loop.process import TREES, Worker, unpack_tree
from benchmarks.loop.row import Row
from benchmarks.loop.table import has_failed, make_loop_table
from benchmarks.loop.timed import make_cold_rows, make_contact_rows, make_motion_rows, make_robot_rows, make_stream_rows
from benchmarks.provenance import ROOT
from benchmarks.replay import first_steps, summed
from benchmarks.report import options, write_report
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

COMMIT = "b6cf3c23"
"""Commit with which the table compares: the last one before the loop was rewritten."""
GROUPS: dict[str, Callable[[], list[Row]]] = {
    "cold": make_cold_rows,
    "streams": make_stream_rows,
    "robots": make_robot_rows,
    "motion": make_motion_rows,
    "contact": make_contact_rows,
    "errors": make_error_rows,
}


def choose_rows(words: list[str]) -> list[Row]:
    """Return the rows of the groups, or with names that contain one of ``words``; all rows without words."""
    named = [word for word in words if word not in GROUPS]
    wanted = [name for name in GROUPS if name in words or named or not words]
    rows = [row for name in wanted for row in GROUPS[name]()]
    return [row for row in rows if not words or row.group in words or any(word in row.name for word in named)]


def time_rows(rows: list[Row], before: Worker | None, after: Worker) -> dict[str, Mapping[str, Any]]:
    """Return a dict from row to the figures of its times; rows of errors have none."""
    found: dict[str, Mapping[str, Any]] = {}
    for row in rows:
        if row.group != "errors":
            try:
                found[row.name] = time_row(row, before, after)
            except RuntimeError as error:
                found[row.name] = {"": {"failed": str(error)}}
            for line in make_lines(row, found[row.name], [{}]):
                report_line(line)
    return found


def judge_rows(
    rows: list[Row], before: Worker | None, after: Worker, frozen: Worker, known: Known | None
) -> dict[str, list[Any]]:
    """Return a dict from row to the figures of its errors, before and after."""
    found: dict[str, list[Any]] = {}
    for row in rows:
        if row.errors:
            both = [judge_row(row, before, frozen, known)] if before else []
            found[row.name] = [*both, judge_row(row, after, frozen, None)]
            if row.group == "errors":
                for line in make_lines(row, {}, found[row.name]):
                    report_line(line)
    return found


def compare(rows: list[Row], commit: str, *, alone: bool, times: bool, errors: bool, again: bool) -> dict[str, Any]:
    """Measure rows, times on the first core and errors on the second; return the report."""
    cores = sorted(os.sched_getaffinity(0))[:2]
    tree, frozen = unpack_tree(commit), unpack_tree(FROZEN)
    known = Known.of(tree.name, again=again) if tree.parent == TREES else None  # other trees may change
    with ExitStack() as open_, ThreadPoolExecutor(2) as both:

        def start(folder: Path, core: int) -> Worker:
            return open_.enter_context(closing(Worker(folder, core)))

        pairs = [(None if alone else start(tree, core), start(ROOT, core)) for core in (cores[0], cores[-1])]
        timed = both.submit(time_rows, rows if times else [], *pairs[0])
        judged = both.submit(judge_rows, rows if errors else [], *pairs[1], start(frozen, cores[-1]), known)
        found, wrong = timed.result(), judged.result()
    lines = [
        line
        for row in rows
        if row.name in found or row.name in wrong
        for line in make_lines(row, found.get(row.name, {}), wrong.get(row.name, [{}]))
    ]
    return {"commit": commit, "lines": lines}


def probe() -> dict[str, float]:
    """Return the figures of the cold step and of the first streamed steps of the coarsest bar."""
    coarse = load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]})
    cold, streamed = (first_steps(name, Simulation(coarse), steps) for name, steps in (("cold", 1), ("streamed", 200)))
    return summed(cold | streamed)


def main() -> int:
    """Measure the chosen rows, write the report and print the table; return 1 if a row could not be measured."""
    parser = options("benchmarks.loop", "One table of before and after: times in turn, true errors.", "loop")
    parser.add_argument("commit", nargs="?", default=COMMIT, help=f"any commit, or a tree (default: {COMMIT})")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help=f"{', '.join(GROUPS)}, or part of a row")
    parser.add_argument("--this-only", action="store_true", help="measure only this tree, without ratios")
    parser.add_argument("--times", action="store_true", help="leave out the errors")
    parser.add_argument("--errors", action="store_true", help="leave out the times")
    parser.add_argument("--again", action="store_true", help="measure the other commit's errors again")
    parser.add_argument("--turns", type=int, help="pairs of runs of each row (default: 2 to 7)")
    parser.add_argument("--list", action="store_true", help="print the names of the rows, and measure nothing")
    given = parser.parse_args()
    rows = choose_rows(given.only)
    if given.list or not rows:
        print("\n".join(f"{row.group}: {row.name}" for row in rows or choose_rows([])))
        return 0 if rows else 2
    rows = [replace(row, turns=given.turns or row.turns) for row in rows]
    wanted = {"times": not given.errors, "errors": not given.times}
    started = time.monotonic()
    report = compare(rows, given.commit, alone=given.this_only, again=given.again, **wanted)
    print(f"measured in {(time.monotonic() - started) / 60.0:.1f} min", file=sys.stderr)
    write_report(given.out, report, probe())
    print(make_loop_table(report))
    return int(any(has_failed(line) for line in report["lines"]))


if __name__ == "__main__":
    sys.exit(main())
