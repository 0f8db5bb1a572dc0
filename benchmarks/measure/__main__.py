# SPDX-License-Identifier: Apache-2.0
"""``make measure``: measure every table whose file was made by another version of the solver; ``--list`` shows them.

An interruption loses only the table that is being measured. All other tables are on disk.
"""

from __future__ import annotations

import argparse
import resource
import signal
import sys
from collections.abc import Sequence

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table as Grid

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
    console = Console()
    console.print(f"solver {solver_commit()} on {machine()}")
    if given.list:
        console.print(overview(chosen))
        return 0
    if solver_commit().endswith(DIRTY):
        console.print("the solver has changes that are not committed: no table counts as one of it", style="yellow")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the script that runs is ended, too
    for name, reason in missing_peers().items():
        console.print(f"left out of the tables: {name}: {reason}", style="yellow")
    try:
        failures = run([table for table in chosen if _wanted(table, given.again, console)], console)
    except KeyboardInterrupt:
        console.print("interrupted: what is measured is kept; the same command goes on")
        return INTERRUPTED
    for text in failures:
        console.print(text, style="red", markup=False)
    console.print(f"{len(failures)} of {len(chosen)} tables failed" if failures else "done; now: make docs")
    return 1 if failures else 0


def overview(tables: Sequence[Table]) -> Grid:
    """Return an overview: provenance, state and approximate duration of each table, and missing packages."""
    grid = Grid("table", "minutes", "made", "state")
    for table in tables:
        report = kept(table)
        made = f"{report.made.date}, {report.made.commit}" if report else "-"
        state = "current" if is_current(table) else "stale"
        lacking = f"; cannot be measured without {', '.join(table.missing())}" if table.missing() else ""
        grid.add_row(table.name, f"{table.minutes:g}", made, state + lacking)
    grid.add_row("all", f"{sum(table.minutes for table in tables):g}", "", "")
    return grid


def run(tables: Sequence[Table], console: Console) -> list[str]:
    """Measure tables one after another; return a message for each table that failed."""
    failures = []
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        for number, table in enumerate(tables, start=1):
            left = sum(item.minutes for item in tables[number - 1 :])
            words = f"{number} of {len(tables)}: {table.name}, {table.minutes:g} min of {left:g} that are left, about"
            task = progress.add_task(words, total=None)
            before = _processor_time()
            reason = measure(table, beat=progress.refresh)
            spent = _processor_time() - before
            taken = progress.tasks[-1].elapsed or 0.0
            progress.remove_task(task)
            if reason is not None:
                failures.append(f"{table.name}: {reason}")
            words = "failed" if reason else "measured"
            times = f"{taken / 60.0:.1f} min, {spent / 60.0:.1f} min of processors"
            console.print(f"{table.name}: {words} in {times}", style="red" if reason else "green")
    return failures


def _processor_time() -> float:
    """Return the processor time of all scripts so far [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _wanted(table: Table, again: bool, console: Console) -> bool:
    """Return whether a table is to be measured; print the reason if it is not."""
    if table.missing():
        console.print(f"skipped: {table.name}: not installed: {', '.join(table.missing())}", style="yellow")
        return False
    if not again and is_current(table):
        console.print(f"skipped: {table.name}: of this solver already")
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
