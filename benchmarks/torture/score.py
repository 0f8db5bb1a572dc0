# SPDX-License-Identifier: Apache-2.0
"""Outcomes of the torture test as a file and as tables."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from benchmarks.markdown import markdown_table
from benchmarks.torture.case import Case, Group, Outcome, Verdict


@dataclass(frozen=True)
class Score:
    """The outcome of a case, with the attributes that identify the case.

    Attributes:
        group: group of the case.
        name: name of the case.
        law: material law of the case.
        policy: policy of the case.
        outcome: outcome of the case.
    """

    group: Group
    name: str
    law: str
    policy: str
    outcome: Outcome

    @classmethod
    def of(cls, case: Case, outcome: Outcome) -> Score:
        """Return the score of a case and its outcome."""
        return cls(case.group, case.name, case.law, case.policy.value, outcome)

    def to_json(self) -> dict[str, Any]:
        """Return plain data; numbers that are not finite become null."""
        values = {key: _plain(value) for key, value in asdict(self.outcome).items() if value != {}}
        return {"group": self.group.value, "name": self.name, "law": self.law, "policy": self.policy, **values}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Score:
        """Return the score that `to_json` wrote."""
        number = {key: math.nan if data[key] is None else float(data[key]) for key in ("error", "bound", "time")}
        counts = {key: int(data[key]) for key in ("iterations", "restarts")}
        figures = {key: float(value) for key, value in data.get("figures", {}).items()}
        outcome = Outcome(verdict=Verdict(data["verdict"]), text=data["text"], figures=figures, **number, **counts)
        return cls(Group(data["group"]), data["name"], data["law"], data["policy"], outcome)


def _plain(value: object) -> object:
    if isinstance(value, Verdict):
        return value.value
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.4g}")
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_scores(path: Path, scores: Sequence[Score]) -> None:
    """Write the outcomes as JSON, one line per case."""
    lines = ",\n ".join(json.dumps(score.to_json()) for score in scores)
    path.write_text('{"cases": [\n ' + lines + "\n]}\n", encoding="utf-8")


def read_scores(path: Path) -> list[Score]:
    """Return the scores that `write_scores` wrote."""
    return [Score.from_json(entry) for entry in json.loads(path.read_text(encoding="utf-8"))["cases"]]


HEADINGS = (
    "group",
    "cases",
    "converged",
    "reported",
    "refused",
    "failed",
    "worst error / bound",
    "restarts",
    "longest case [CPU s]",
)
WALK_HEADINGS = (
    "random walk",
    "steps",
    "distance from rest at the end",
    "change of memory [MB]",
    "time per step, first thousand [ms]",
    "time per step, last thousand [ms]",
    "iterations of the first thousand steps",
    "iterations of the last thousand steps",
)


def summary(scores: Sequence[Score]) -> list[tuple[str, ...]]:
    """Return one row for each group and one row for all, as texts under `HEADINGS`.

    The worst error is the one with the largest ratio to its bound, among the cases that are not reported.
    """
    rows = [_row(group.value, [score for score in scores if score.group is group]) for group in Group]
    return [*(row for row in rows if row[1] != "0"), _row("all", scores)]


def _row(group: str, scores: Sequence[Score]) -> tuple[str, ...]:
    outcomes = [score.outcome for score in scores]
    judged = [item for item in outcomes if math.isfinite(item.error) and math.isfinite(item.bound) and item.bound > 0.0]
    judged = [item for item in judged if item.verdict is not Verdict.REPORTED]
    worst = max(judged, key=lambda item: item.error / item.bound, default=None)
    error = "-" if worst is None else f"{worst.error:.1e} / {worst.bound:.0e}"
    counts = [len(outcomes), *(sum(item.verdict is verdict for item in outcomes) for verdict in Verdict)]
    restarts = sum(outcome.restarts for outcome in outcomes)
    longest = max((outcome.time for outcome in outcomes if math.isfinite(outcome.time)), default=math.nan)
    return (group, *map(str, counts), error, str(restarts), f"{longest:.1f}" if math.isfinite(longest) else "-")


def walk_rows(scores: Sequence[Score]) -> list[tuple[str, ...]]:
    """Return one row for each random walk, as texts under `WALK_HEADINGS`."""
    walks = [score for score in scores if score.group is Group.WALKS and score.outcome.figures]
    return [_walk_row(score.name, score.outcome.figures) for score in walks]


def _walk_row(name: str, figures: Mapping[str, float]) -> tuple[str, ...]:
    times = (f"{figures[key]:.3f}" for key in ("first_ms", "last_ms"))
    iterations = (f"{figures[key]:.0f}" for key in ("first_iterations", "last_iterations"))
    return (
        name,
        f"{figures['steps']:.0f}",
        f"{figures['drift']:.1e}",
        f"{figures['memory_mb']:+.1f}",
        *times,
        *iterations,
    )


HONESTY_HEADINGS = (
    "stream",
    "error / tolerance at tolerance 1e-3",
    "at 1e-4",
    "at 1e-5",
    "iterations per step at tolerance 1e-3",
    "at 1e-4",
    "at 1e-5",
)


def honesty_rows(scores: Sequence[Score]) -> list[tuple[str, ...]]:
    """Return one row for each stream of group 9, as texts under `HONESTY_HEADINGS`; '-' if no step converged."""
    streams: dict[str, list[Score]] = {}
    for score in scores:
        if score.group is Group.HONESTY:
            streams.setdefault(score.name.rpartition(", tolerance ")[0], []).append(score)
    rows = []
    for name, found in streams.items():
        found.sort(key=lambda score: -float(score.name.rpartition(" ")[2]))
        errors = (score.outcome.error for score in found)
        iterations = (score.outcome.figures["iterations a step"] for score in found)
        texts = (f"{error:.2g}" if math.isfinite(error) else "-" for error in errors)
        rows.append((name, *texts, *(f"{count:.1f}" for count in iterations)))
    return rows


def rich_table(scores: Sequence[Score]) -> Table:
    """Return the summary as a table for a terminal."""
    table = Table(title="torture", title_justify="left")
    for i, heading in enumerate(HEADINGS):
        table.add_column(heading, justify="right" if i else "left")
    rows = summary(scores)
    for i, row in enumerate(rows):
        table.add_row(*row, style="bold" if i == len(rows) - 1 else None, end_section=i == len(rows) - 2)
    return table


def torture_tables(data: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of docs/torture.md, as Markdown, from the data that `write_scores` wrote."""
    scores = [Score.from_json(entry) for entry in data["cases"]]
    return {
        "torture": markdown_table(HEADINGS, summary(scores)),
        "walks": markdown_table(WALK_HEADINGS, walk_rows(scores)),
        "honesty": markdown_table(HONESTY_HEADINGS, honesty_rows(scores)),
    }
