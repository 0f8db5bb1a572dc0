# SPDX-License-Identifier: Apache-2.0
"""Times of both commits in turn, and the figures of each row of the table."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from benchmarks.loop.process import Worker
from benchmarks.loop.row import Row, Task
from benchmarks.loop.table import make_cells

Figures = dict[str, Any]


def time_row(row: Row, before: Worker | None, after: Worker) -> dict[str, Figures]:
    """Let both processes carry out a row's task in turn; return a dict from part to the figures of its times."""
    task, pairs = row.tasks[0], []
    workers = [worker for worker in (before, after) if worker]
    setups = {worker: _ask(worker, "time", task, repeats=0)["setup"] for worker in workers}
    for turn in range(row.turns):
        order = workers if turn % 2 == 0 else workers[::-1]
        answers = {worker: _ask(worker, "time", task, repeats=row.repeats)["runs"] for worker in order}
        pairs.append([answers[worker] for worker in workers])
    return {
        name: _compare_times(row, [[_take_median(runs, name) for runs in pair] for pair in pairs])
        | {"setup": [setups[worker] for worker in workers]}
        for name in pairs[0][0][0]
    }


def _take_median(runs: Sequence[Mapping[str, Figures]], part: str) -> Figures:
    """Return the figures of a part's run, with the median time of all runs."""
    return runs[0][part] | {"seconds": median(run[part]["seconds"] for run in runs)}


def _compare_times(row: Row, pairs: Sequence[Sequence[Figures]]) -> Figures:
    """Return the figures of a part from the pairs of its runs; a pair has one run if only this tree is measured."""
    columns = [*zip(*pairs, strict=True)]
    values = [_convert(row, column[0], median(run["seconds"] for run in column)) for column in columns]
    first = pairs[0]
    both = len(first) == 2
    return {
        "before": values[0] if both else None,
        "after": values[-1],
        "ratio": median(pair[1]["seconds"] / pair[0]["seconds"] for pair in pairs) if both else None,
        "iterations": [run["iterations"] / run["steps"] for run in first],
        "unconverged": [run["unconverged"] for run in first],
        "same": both and first[0]["digest"] == first[1]["digest"],
    }


def _convert(row: Row, run: Figures, seconds: float) -> float:
    if row.unit == "real time":
        return run["simulated"] / seconds
    return 1e3 * seconds / run["steps"] if row.unit == "ms" else seconds


def _ask(worker: Worker, work: str, task: Task, **options: Any) -> Figures:
    """Return an answer.

    Raises:
        RuntimeError: the work failed in the process.
    """
    answer = worker.ask(work, task, **options)
    if "failed" in answer:
        raise RuntimeError(answer["failed"])
    return answer


def make_lines(row: Row, times: Mapping[str, Figures], errors: Sequence[Mapping[str, Figures]]) -> list[Figures]:
    """Return the lines of the table for a row: figures, and each target with whether it is met.

    Args:
        row: the row.
        times: dict from part to figures of times; empty for a row of errors.
        errors: dicts from part to figures of errors, before and after, or only after.
    """
    lines = []
    for part in times or errors[-1]:
        line: Figures = {"group": row.group, "name": f"{row.name}: {part}" if part else row.name, "unit": row.unit}
        line |= times.get(part, {})
        judged = [found.get(part, {}) for found in errors]
        hidden = ("seconds", "unit", "whole", "tasks") if times else ("seconds", "unit")
        if not times:
            seconds = [found.get("seconds") for found in judged]
            line |= {"before": seconds[0] if len(seconds) == 2 else None, "after": seconds[-1]}
            line["ratio"] = seconds[1] / seconds[0] if len(seconds) == 2 and seconds[0] else None
        for name in {name: None for found in judged for name in found if name not in hidden}:
            if name not in line:
                line[name] = [found.get(name) for found in judged]
        lines.append(line | {"targets": _judge_targets(row, part, line)})
    return lines


def _judge_targets(row: Row, part: str, line: Figures) -> list[tuple[str, bool | None]]:
    """Return each target of a row's part in words, with whether a line meets it; None if it is unknown."""
    figures = {name: value[-1] if isinstance(value, list) and value else value for name, value in line.items()}
    for name in ("path", "whole"):
        pair = line.get(name)
        if pair and len(pair) == 2 and pair[0]:
            figures[f"{name} over before"] = pair[1] / pair[0]
    return [(target.words, target.met(figures)) for target in row.targets if target.part in (None, part)]


def report_line(line: Figures) -> None:
    """Print a line of the table to the standard error."""
    print(" | ".join(make_cells(line)), file=sys.stderr, flush=True)
