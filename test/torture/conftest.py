# SPDX-License-Identifier: Apache-2.0
"""Options of the torture test, and its table and picture at the end of the run."""

from __future__ import annotations

import json
import os
import resource
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.torture.case import Group
from benchmarks.torture.score import Score, rich_table, write_scores

OUTPUT = Path(os.environ.get("TORTURE_OUTPUT", "runs/torture"))
"""Folder of torture.json and torture.png."""

EXAMPLES = int(os.environ.get("TORTURE_EXAMPLES", "0"))
"""Random examples of each fuzzing test; 0 for a few fixed ones."""
MEMORY, SECONDS = 4 << 30, 300 + EXAMPLES
"""Address space [bytes] that a fuzzing test may use in addition, and its longest time [s]."""


@pytest.fixture
def limited() -> Iterator[None]:
    """Limit memory and time of a test: beyond the limits, its process raises MemoryError or TimeoutError."""

    def end(*_: object) -> None:
        raise TimeoutError(f"the examples took more than {SECONDS} s")

    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, most))
    handler = signal.signal(signal.SIGALRM, end)
    signal.alarm(SECONDS)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, handler)
    resource.setrlimit(resource.RLIMIT_AS, (before, most))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the table of the torture cases that ran, and write it and its picture; do nothing if none ran."""
    reports = [report for key in ("passed", "failed") for report in terminalreporter.getreports(key)]
    texts = [value for report in reports for key, value in report.user_properties if key == "torture"]
    if not texts:
        return
    from rich.console import Console

    from benchmarks.torture.picture import draw_scores  # matplotlib takes a second

    scores = [Score.from_json(json.loads(text)) for text in texts]
    scores.sort(key=lambda score: list(Group).index(score.group))
    Console(file=terminalreporter._tw._file, width=140).print(rich_table(scores))
    OUTPUT.mkdir(parents=True, exist_ok=True)
    write_scores(OUTPUT / "torture.json", scores)
    draw_scores(OUTPUT / "torture.png", scores)
    terminalreporter.write_line(f"written: {OUTPUT / 'torture.json'}, {OUTPUT / 'torture.png'}")
