# SPDX-License-Identifier: Apache-2.0
"""``make measure``: measure every table whose file was made by another version of the solver; ``--list`` shows them.

An interruption loses only the table that is being measured. All other tables are on disk.
"""

from __future__ import annotations

import argparse
import resource
import signal
import sys
import time
from collections.abc import Sequence

from benchmarks.cold import missing as missing_peers
from benchmarks.measure.run import is_current, kept, measure
from benchmarks.measure.tables import NAMES, TABLES, Table
from benchmarks.provenance import DIRTY, machine, solver_commit

INTERRUPTED = 130
"""Exit status after an interruption."""


def main() -> int:
    """Measure the requested tables; return 1 if a table failed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.measure", description="Measure all tables anew.")
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=NAMES, help=f"of {', '.join(NAMES)}")
    parser.add_argument("--again", action="store_true", help="those of this solver, too")
    parser.add_argument("--list", action="store_true", help="show the tables and measure nothing")
    given = parser.parse_args()
    chosen = [table for table in TABLES if not given.only or table.name in given.only]
    print(f"solver {solver_commit()} on {machine()}")
    if given.list:
        print("\n".join(overview(chosen)))
        return 0
    if solver_commit().endswith(DIRTY):
        print("the solver has changes that are not committed: no table counts as one of it")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the script that runs is ended, too
    for name, reason in missing_peers().items():
        print(f"left out of the tables: {name}: {reason}")
    try:
        failures = run([table for table in chosen if is_wanted(table, again=given.again)])
    except KeyboardInterrupt:
        print("interrupted: what is measured is kept; the same command goes on")
        return INTERRUPTED
    print(*failures, sep="\n")
    print(f"{len(failures)} of {len(chosen)} tables failed" if failures else "done; now: make docs")
    return 1 if failures else 0


def overview(tables: Sequence[Table]) -> list[str]:
    """Return a line for each table: minutes, provenance and state; and a line with the minutes of all."""
    lines = []
    for table in tables:
        report = kept(table)
        made = f"{report.made.date}, {report.made.commit}" if report else "-"
        state = "current" if is_current(table) else "stale"
        lacking = f"; cannot be measured without {', '.join(table.missing())}" if table.missing() else ""
        lines.append(f"{table.name:20} {table.minutes:5g} min  {made:20} {state}{lacking}")
    return [*lines, f"{'all':20} {sum(table.minutes for table in tables):5g} min"]


def run(tables: Sequence[Table]) -> list[str]:
    """Measure tables one after another; return a message for each table that failed."""
    failures = []
    for number, table in enumerate(tables, start=1):
        left = sum(item.minutes for item in tables[number - 1 :])
        print(f"{number} of {len(tables)}: {table.name}, about {table.minutes:g} min of {left:g}", flush=True)
        started, before = time.monotonic(), _processor_time()
        reason = measure(table)
        if reason is not None:
            failures.append(f"{table.name}: {reason}")
        taken, spent = time.monotonic() - started, _processor_time() - before
        words = "failed" if reason else "measured"
        print(f"{table.name}: {words} in {taken / 60.0:.1f} min, {spent / 60.0:.1f} min of processors", flush=True)
    return failures


def _processor_time() -> float:
    """Return the processor time of all scripts so far [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def is_wanted(table: Table, *, again: bool) -> bool:
    """Return whether a table is to be measured; print the reason if it is not."""
    if table.missing():
        print(f"skipped: {table.name}: not installed: {', '.join(table.missing())}")
        return False
    if not again and is_current(table):
        print(f"skipped: {table.name}: of this solver already")
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
