# SPDX-License-Identifier: Apache-2.0
"""Outcomes of the torture test as plain data, and their table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from typing import Any

from benchmarks.markdown import markdown_table
from benchmarks.torture.case import Case, Group, Outcome, Verdict, attempt
from benchmarks.torture.catalogue import all_cases

HEADINGS = (
    "group", "cases", "converged", "reported", "refused", "failed", "worst error / bound", "restarts",
    "longest case [CPU s]",
)  # fmt: skip
Score = Mapping[str, Any]
"""Group, name, law and policy of a case, and the fields of its `Outcome`; numbers that are not finite are None."""


def run_case(name: str) -> Score:
    """Run the case with an id, in any process, and return its score."""
    case = _catalogue()[name]
    return score_of(case, attempt(case))


@cache
def _catalogue() -> dict[str, Case]:
    return {case.id: case for case in all_cases()}


def score_of(case: Case, outcome: Outcome) -> Score:
    """Return a case and its outcome as plain JSON types."""
    values = {key: _plain(value) for key, value in asdict(outcome).items()}
    own = {"group": case.group.value, "name": case.name, "law": case.law, "policy": case.policy.value}
    return {**own, **values, "verdict": outcome.verdict.value}


def _plain(value: object) -> object:
    if isinstance(value, float):
        return float(f"{value:.4g}") if math.isfinite(value) else None
    return value


def torture_table(scores: Sequence[Score]) -> dict[str, str]:
    """Return the table with one row for each group and one row for all, under its name.

    The worst error is the one with the largest ratio to its bound, among the cases that are not reported.
    """
    groups = {group.value: [score for score in scores if score["group"] == group.value] for group in Group}
    rows = [_row(name, found) for name, found in groups.items() if found]
    return {"torture": markdown_table(HEADINGS, [*rows, _row("all", scores)])}


def _row(group: str, scores: Sequence[Score]) -> tuple[str, ...]:
    firm = [score for score in scores if score["verdict"] != Verdict.REPORTED.value]
    judged = [score for score in firm if score["error"] is not None and score["bound"]]
    worst = max(judged, key=lambda score: score["error"] / score["bound"], default=None)
    error = "-" if worst is None else f"{worst['error']:.1e} / {worst['bound']:.0e}"
    counts = [len(scores), *(_count(scores, verdict) for verdict in Verdict)]
    restarts, longest = sum(score["restarts"] for score in scores), max(score["time"] for score in scores)
    return (group, *map(str, counts), error, str(restarts), f"{longest:.1f}")


def _count(scores: Iterable[Score], verdict: Verdict) -> int:
    return sum(score["verdict"] == verdict.value for score in scores)
