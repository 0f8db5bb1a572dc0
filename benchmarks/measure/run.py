# SPDX-License-Identifier: Apache-2.0
"""Measurement of one table in a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from benchmarks.measure.tables import Table
from benchmarks.process import worker_environment
from benchmarks.provenance import ROOT
from benchmarks.report import IMAGES, Report, read_report

LOGS = ROOT / "runs" / "measure"
"""Folder for the output of the scripts."""
PATIENCE = 10.0
"""Time limit of a script, divided by its expected duration; the first minutes may be needed for compiling."""
LEAST = 20.0
"""Least time limit of a script [min]."""


def kept(table: Table) -> Report | None:
    """Return the report on disk; None if there is no file, or if it has another form."""
    try:
        return read_report(table.file)
    except (OSError, ValueError):
        return None


def is_current(table: Table) -> bool:
    """Return whether the report on disk was made by this version of the solver."""
    report = kept(table)
    return report is not None and report.made.is_current


def measure(table: Table) -> str | None:
    """Run the script of a table, which replaces the table's file when it ends.

    Returns:
        None after success, else a short description of the failure.
    """
    LOGS.mkdir(parents=True, exist_ok=True)
    log = LOGS / f"{table.name}.log"
    command = [sys.executable, "-m", table.module, "--out", str(table.file), "--pictures"]
    environment = worker_environment(1)
    if table.ros:
        environment = {**os.environ, "PYTHONPATH": environment["PYTHONPATH"]}
    environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    before = table.file.stat().st_mtime_ns if table.file.is_file() else 0
    with (
        log.open("w") as output,
        subprocess.Popen(
            [*command, str(IMAGES)],
            cwd=ROOT,
            env=environment,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        ) as process,
    ):
        try:
            status = process.wait(60.0 * max(LEAST, PATIENCE * table.minutes))
        except subprocess.TimeoutExpired:
            _end(process)
            status = None
        except BaseException:
            _end(process)  # an interruption
            raise
    written = table.file.is_file() and table.file.stat().st_mtime_ns != before
    if status == 0 and written:
        return None
    ended = "took too long and was ended" if status is None else f"ended with status {status}"
    return f"{ended}; its table is {'written' if written else 'as it was'}; see {log.relative_to(ROOT)}: {_last(log)}"


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill a script and all processes that it has started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _last(log: Path) -> str:
    lines = [line.strip() for line in log.read_text(errors="replace").splitlines() if line.strip()]
    return lines[-1] if lines else "it printed nothing"
