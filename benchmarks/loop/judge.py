# SPDX-License-Identifier: Apache-2.0
"""True errors of rows: each commit's finer solves, checked by Newton steps of the frozen one, and their figures."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.loop.process import TREES, Worker
from benchmarks.loop.row import Row, Task
from benchmarks.loop.truth import AGREE

SUMS = (
    "seconds",
    "whole",
    "iterations",
    "steps",
    "unconverged",
    "told",
    "judged",
    "unjudged",
    "beyond",
    "elsewhere",
    "saddles",
    "checks",
    "unverified",
)
"""Figures that are added over the tasks of a row."""
VERSION = 1
"""Number of the way of measuring errors; a new one makes known errors unknown."""
ELSEWHERE = 0.03
"""Distance of another equilibrium, divided by the body's size."""
Figures = dict[str, Any]


@dataclass
class Known:
    """True errors of a commit that were measured before; they do not change, and to measure them takes long.

    Attributes:
        path: file that keeps them.
        found: dict from digest of a task and a way of measuring to the answer of the process.
    """

    path: Path
    found: dict[str, Figures] = field(default_factory=dict)

    @classmethod
    def of(cls, commit: str, *, again: bool) -> Known:
        """Return the known errors of a commit; none of them with ``again``."""
        path = TREES / f"known-{commit}-{VERSION}.json"
        kept = path.is_file() and not again
        return cls(path, json.loads(path.read_text(encoding="utf-8")) if kept else {})

    def keep(self, key: str, answer: Figures) -> None:
        """Keep an answer, also on disk."""
        self.found[key] = answer
        self.path.parent.mkdir(parents=True, exist_ok=True)
        beside = self.path.with_suffix(".new")
        beside.write_text(json.dumps(self.found) + "\n", encoding="utf-8")
        beside.replace(self.path)


def judge_row(row: Row, worker: Worker, frozen: Worker, known: Known | None) -> dict[str, Figures]:
    """Return a dict from part to the figures of a row's true errors with one commit.

    Args:
        row: the row.
        worker: process with the commit's package.
        frozen: process with the package whose Newton steps check positions.
        known: answers of earlier runs, also kept; None to measure anew.
    """
    if row.errors == "path":
        task = row.tasks[0]
        return _recall(known, f"path {task.key} {row.fine}", lambda: _judge_path(row, task, worker, frozen))
    way = f"{row.fine} {row.bends} {row.push}"
    answers = [
        _recall(known, f"each {task.key} {way}", lambda task=task: _judge_task(row, task, worker, frozen))
        for task in row.tasks
    ]
    good = [answer for answer in answers if "failed" not in answer]
    each = [summarise(answer["each"], 1.0 / answer["unit"]) | answer for answer in good]
    figures: Figures = {name: sum(found[name] for found in each) for name in SUMS}
    figures["error"] = max((found["error"] for found in each if found["error"] is not None), default=None)
    figures["failed"] = [answer["failed"] for answer in answers if "failed" in answer]
    figures["cut"] = sum(found["given"] - found["steps"] for found in each)
    if row.bends is not None:
        figures["bent"] = sum(found["bent"] for found in each)
        figures["silent"] = sum(_is_silent(found) for found in each)
    labels = [task.label for task, answer in zip(row.tasks, answers, strict=True) if "failed" not in answer]
    figures["tasks"] = {
        label: {name: found[name] for name in found if name != "each"} | {"worst": _find_worst(found["each"])}
        for label, found in zip(labels, each, strict=True)
        if label
    }
    return {"": figures}


def _recall(known: Known | None, key: str, measure: Any) -> Figures:
    if known and key in known.found:
        return known.found[key]
    answer = measure()
    if known and "failed" not in answer and "failed" not in answer.get("", {}):
        known.keep(key, answer)
    return answer


def _judge_path(row: Row, task: Task, worker: Worker, frozen: Worker) -> Figures:
    """Return the errors of the parts of a stream; all parts have the number of checked finer solves."""
    with tempfile.NamedTemporaryFile(suffix=".npz") as places:
        answer = worker.ask("path", task, fine=row.fine, path=places.name)
        if "failed" in answer:
            return {"": answer}
        judged = frozen.ask("newton", task, path=places.name)
    if "failed" in judged:
        return {"": judged}
    for part in answer.values():
        truths = [
            {"newton": None if distance is None else distance / part["unit"], "definite": definite}
            for distance, definite in judged["steps"].values()
        ]
        part |= {"checks": len(truths), "unverified": sum(not _is_equilibrium(truth) for truth in truths)}
    return answer


def _judge_task(row: Row, task: Task, worker: Worker, frozen: Worker) -> Figures:
    """Return the steps of a task, with the distances that the frozen package gives for them."""
    with tempfile.NamedTemporaryFile(suffix=".npz") as places:
        push = row.push or "obstacles" in task.text
        answer = worker.ask("each", task, fine=row.fine, bends=row.bends, path=places.name, push=push)
        if "failed" in answer:
            return answer
        judged = frozen.ask("newton", task, path=places.name)
    if "failed" in judged:
        return judged
    for name, (distance, definite) in judged["steps"].items():
        kind, number = name.split()
        given = {"newton": None if distance is None else distance / answer["unit"], "definite": definite}
        answer["each"][int(number)][kind] = given
    return answer


def summarise(steps: Sequence[Mapping[str, Any]], size: float) -> Figures:
    """Return figures of judged steps.

    The error of a step is its distance from the finer solve. Without one, it is the length of the Newton step; the
    larger of both, if the finer solve fails its check. A step whose finer solve ends at another equilibrium, while the
    Newton step says that it was near its own, is not beyond its tolerance; it is counted under ``elsewhere``, and under
    ``saddles`` if it was called stable and is not. A step that says that it is at a saddle needs no judge.

    Args:
        steps: steps with their distances.
        size: the body's size in tolerances.
    """
    errors, away, checks, unjudged = [], 0, [], 0
    for step in (step for step in steps if step["converged"]):
        error, newton, told = step.get("error"), step.get("found", {}).get("newton"), step["stable"] is False
        good = _is_verified(step)
        if error is None or (good is False and newton is not None):
            error = max((each for each in (error, newton) if each is not None), default=None)
        if error is not None and error > ELSEWHERE * size and (told or (newton is not None and newton <= 1.0)):
            away, error = away + 1, newton
        if error is not None:
            errors.append(error)
        unjudged += error is None and not told
        checks += [] if good is None or told else [good]
    claimed = [step for step in steps if step["converged"] and step["stable"]]
    return {
        "iterations": sum(step["iterations"] for step in steps),
        "steps": len(steps),
        "unconverged": sum(not step["converged"] for step in steps),
        "told": sum(step["converged"] and step["stable"] is False for step in steps),
        "judged": len(errors),
        "unjudged": unjudged,
        "error": max(errors, default=None),
        "beyond": sum(error > 1.0 for error in errors),
        "elsewhere": away,
        "saddles": sum(_is_saddle(step, size) for step in claimed),
        "checks": len(checks),
        "unverified": len(checks) - sum(checks),
    }


def _is_equilibrium(truth: Mapping[str, Any]) -> bool:
    return bool(truth["definite"]) and truth["newton"] is not None and truth["newton"] <= AGREE


def _is_verified(step: Mapping[str, Any]) -> bool | None:
    """Return whether the finer solve of a step passes all its checks; None if it has none."""
    if "verified" not in step and "truth" not in step:
        return None
    return step.get("verified", True) and ("truth" not in step or _is_equilibrium(step["truth"]))


def _is_saddle(step: Mapping[str, Any], size: float) -> bool:
    """Return whether the tangent is indefinite at the equilibrium near a step; without one, at the step."""
    near = "truth" in step and step["error"] <= ELSEWHERE * size
    return step.get("truth" if near else "found", {}).get("definite") is False


def _is_silent(found: Figures) -> bool:
    """Return whether a column stayed straight and the step did not say so."""
    last = found["each"][-1]
    return not found["bent"] and last["converged"] and last["stable"] is not False


def _find_worst(steps: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Return the step with the largest error, with its number."""
    numbered = [{"number": number, **step} for number, step in enumerate(steps)]
    return max(numbered, key=lambda step: step.get("error") or 0.0, default={})
