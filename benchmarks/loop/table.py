# SPDX-License-Identifier: Apache-2.0
"""The table of before and after as Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.loop.row import STABLE
from benchmarks.markdown import markdown_table

HEADS = (
    "row",
    "before",
    "now",
    "now / before",
    "iterations a step",
    "largest true error [tolerances]",
    "steps beyond one",
    "target",
    "",
)
USUAL = [target.words for target in STABLE]
"""Targets that are not repeated in each row."""
SAYS = {True: "met", False: "**missed**", None: "not judged"}


def make_loop_table(report: Mapping[str, Any]) -> str:
    """Return the table of a report, and a sentence about its targets."""
    lines = report["lines"]
    rows = [make_cells(line) for line in lines]
    missed = sum(met is False for line in lines for _, met in line["targets"])
    unknown = sum(met is None for line in lines for _, met in line["targets"])
    total = sum(len(line["targets"]) for line in lines)
    usual = (
        f"Rows with errors also have the targets {', '.join(USUAL[:-2])}, and rows of errors {', '.join(USUAL[-2:])}."
    )
    said = f"Of {total} targets, {total - missed - unknown} are met, {missed} missed, {unknown} not judged."
    return f"{markdown_table(HEADS, rows)}\n\n{usual} {said} *Before* is {report['commit']}."


def has_failed(line: Mapping[str, Any]) -> bool:
    """Return whether a row, or a task of it, could not be measured with one of the commits."""
    failed = line.get("failed")
    return bool(failed) and (isinstance(failed, str) or any(failed))


def make_cells(line: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the cells of a line, below `HEADS`."""
    unit = {"ms": "ms", "s": "s", "real time": "x"}[line["unit"]]
    error = _write_pair(line.get("error"))
    if line.get("path"):
        error = f"path: {_write_pair([_write_percent(value) for value in line['path']])}"
    return (
        line["name"] + _write_remarks(line),
        _convert(line.get("before"), unit),
        _convert(line.get("after"), unit),
        _convert(line.get("ratio")),
        _write_pair(_divide_iterations(line)),
        error,
        _write_pair(line.get("beyond")),
        ", ".join(words for words, _ in line["targets"] if words not in USUAL),
        "**failed**" if has_failed(line) else _write_verdict(line["targets"]),
    )


def _write_verdict(targets: list[tuple[str, bool | None]]) -> str:
    """Return "met", or the missed targets; "not judged" if none is missed and one is unknown."""
    missed = [words.split()[0] for words, met in targets if met is False]
    if missed:
        return f"{SAYS[False]}: {', '.join(missed)}"
    return SAYS[None if any(met is None for _, met in targets) else True]


def _divide_iterations(line: Mapping[str, Any]) -> list[Any] | None:
    """Return iterations a step, before and after; a row of errors has those of all steps."""
    found, steps = line.get("iterations"), line.get("steps")
    if not found or not steps:
        return found
    return [None if each is None else each / max(count or 1, 1) for each, count in zip(found, steps, strict=True)]


def _write_remarks(line: Mapping[str, Any]) -> str:
    """Return figures of the row that have no column of their own."""
    words = [f"failed: {line['failed']}"] if has_failed(line) else []
    for name in ("bent", "silent", "told", "unconverged", "unjudged", "saddles", "elsewhere", "cut", "whole"):
        values = line.get(name)
        if values and any(value for value in values):
            words.append(f"{'unstable' if name == 'told' else name} {_write_pair(values)}{' s' * (name == 'whole')}")
    judged, checks, failed = line.get("judged"), line.get("checks"), line.get("unverified")
    if judged and line["unit"] == "s":
        words.append(f"judged {_write_pair(judged)}")
    if checks and any(checks):
        pairs = zip(failed, checks, strict=True)
        words.append(
            "verified " + _write_pair(["-" if all_ is None else f"{all_ - bad} of {all_}" for bad, all_ in pairs])
        )
    return f" ({'; '.join(words)})" if words else ""


def _convert(value: float | None, unit: str = "") -> str:
    return "" if value is None else f"{value:.3g} {unit}".strip()


def _write_percent(value: float | None) -> str | None:
    return None if value is None else f"{100.0 * value:.2g} %"


def _write_pair(values: Any) -> str:
    """Return two values as "a to b", or one if there is one or if both look alike."""
    if not values:
        return ""
    texts = ["-" if value is None else value if isinstance(value, str) else f"{value:.3g}" for value in values]
    return " to ".join(dict.fromkeys(texts))
