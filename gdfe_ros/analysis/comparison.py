# SPDX-License-Identifier: Apache-2.0
"""Comparison of two recorded runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.bag_steps import BagStep, BagSteps, StepKey, step_keys
from gdfe_ros.analysis.difference import Difference, Differences
from gdfe_ros.scene.document import parse_document


@dataclass(frozen=True, eq=False)
class Comparison:
    """Result of ``compare_bags``.

    Attributes:
        differences: differences of the common steps.
        only: number of steps that only the first bag has, and number of steps that only the second bag has.
        foreign: topics of unknown type in the first and in the second bag, which are not compared.
        scene_changes: dict from dotted key to the values in the first and in the second scene, where they differ.
    """

    differences: Differences
    only: tuple[int, int]
    foreign: tuple[list[str], list[str]]
    scene_changes: dict[str, tuple[Any, Any]]

    def verdict(self, factor: float = 0.0) -> Difference:
        """Return the verdict on the whole bags; differences up to ``factor`` solver tolerances are allowed.

        It is DIFFERENT if a bag has a step that the other bag lacks, or if no step is common. It is INCOMPLETE if the
        common steps agree, but topics were not compared.
        """
        if any(self.only) or not self.differences.steps:
            return Difference.DIFFERENT
        verdict = self.differences.verdict(factor)
        return Difference.INCOMPLETE if any(self.foreign) and verdict is not Difference.DIFFERENT else verdict


def compare_bags(first: str | Path, second: str | Path) -> Comparison:
    """Compare all arrays of the steps that two bags have in common; equal `StepKey`s identify a common step.

    Raises:
        RecordingError: a bag cannot be read or was not recorded by this package's node.

    Example:
        >>> comparison = compare_bags("runs/a", "runs/b")
        >>> comparison.differences.verdict()
    """
    runs = BagRun(first), BagRun(second)
    keys = [step_keys(run.records) for run in runs]
    common = set(keys[0]) & set(keys[1])
    differences = Differences(runs[0].scene)
    steps = [BagSteps(run) for run in runs]
    pairs = zip(*(_chosen(source, common) for source in steps), strict=True)
    waiting: tuple[dict[StepKey, BagStep], dict[StepKey, BagStep]] = {}, {}
    # A reset sets stamps back, so the second bag may have the same keys in another order.
    for pair in pairs:
        for side, step in enumerate(pair):
            waiting[side][step.key] = step
        for key in waiting[0].keys() & waiting[1].keys():
            differences.add(key, waiting[0].pop(key).samples, waiting[1].pop(key).samples)
    only = len(keys[0]) - len(common), len(keys[1]) - len(common)
    return Comparison(differences, only, (steps[0].foreign, steps[1].foreign), _scene_changes(*runs))


def _chosen(steps: BagSteps, keys: set[StepKey]) -> Iterator[BagStep]:
    return (step for step in steps if step.key in keys)


def _scene_changes(first: BagRun, second: BagRun) -> dict[str, tuple[Any, Any]]:
    entries = [dict(_entries(parse_document(run.reader.run.scene, heading="scene").data)) for run in (first, second)]
    keys = [*entries[0], *(key for key in entries[1] if key not in entries[0])]
    pairs = {key: (entries[0].get(key), entries[1].get(key)) for key in keys}
    return {key: pair for key, pair in pairs.items() if pair[0] != pair[1]}


def _entries(data: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted key and value of each entry of a scene; a list without mappings is one value."""
    if isinstance(data, dict):
        parts = data.items()
    elif isinstance(data, list) and any(isinstance(item, dict) for item in data):
        parts = enumerate(data)
    else:
        yield path, data
        return
    for key, value in parts:
        yield from _entries(value, f"{path}.{key}" if path else str(key))
