# SPDX-License-Identifier: Apache-2.0
"""Comparison of two runs: which arrays are not bit-identical, and by how much they differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.bag_run import CONTACTS, RECORD, BagRun, BagStep, BagSteps, StepKey, step_keys
from gdfe_ros.analysis.message_values import Values
from gdfe_ros.scene import Scene
from gdfe_ros.scene.document import parse_document

LENGTHS = frozenset({"x", "y", "z", "ux", "uy", "uz"})
VELOCITIES = ("vx", "vy", "vz")
_RATIOS = ("eps_eq", "J", "omega", "min_det")
CUT = 100.0
"""Assumed error estimate, divided by the tolerance, if a step has no finite estimate, e.g. because of a deadline."""
_COSTS = ("iterations", "substeps", "error_estimate", "skipped")


class Difference(Enum):
    """Result of a comparison."""

    IDENTICAL = "bit-identical"
    WITHIN = "within the tolerance"
    INCOMPLETE = "incomplete"
    DIFFERENT = "different"


@dataclass(frozen=True)
class Place:
    """A number that differs between two runs: its step, its index, and the difference.

    Attributes:
        key: key of the step.
        element: index of the vertex, cell or entry.
        gap: difference of the two runs, in the unit of the field; infinite if one run has NaN.
    """

    key: StepKey
    element: int
    gap: float

    @property
    def stamp(self) -> float:
        """Simulation time at the end of the step [s]."""
        return self.key[0] * 1e-9


@dataclass(kw_only=True)
class FieldDifference:
    """Difference of one field of one topic.

    Attributes:
        topic: name of the topic without the node's name.
        field: name of the field in the topic's messages.
        compared: number of pairs of arrays.
        differing: number of pairs of arrays that are not bit-identical.
        resized: number of pairs of arrays with different lengths; their numbers are not compared.
        first: the first number that differs.
        most: the number that differs most; NaN counts as the largest difference.
        scale: largest magnitude in the first run.
        gaps: dict from the accuracy of a step to the largest difference in all steps with this accuracy.
    """

    topic: str
    field: str
    compared: int = 0
    differing: int = 0
    resized: int = 0
    first: Place | None = None
    most: Place | None = None
    scale: float = 0.0
    gaps: dict[float, float] = field(default_factory=dict)

    @property
    def largest(self) -> float:
        """Largest difference, in the unit of the field; infinite if one run has NaN."""
        return self.most.gap if self.most else 0.0

    def add(self, key: StepKey, first: NDArray[Any], second: NDArray[Any], *, tolerance: float = 0.0) -> None:
        """Compare two arrays of a step whose accuracy is ``tolerance``."""
        self.compared += 1
        if first.size and np.isfinite(first).any():
            self.scale = max(self.scale, float(np.nanmax(np.abs(first), where=np.isfinite(first), initial=0.0)))
        if first.shape != second.shape:
            self.resized += 1
            self.differing += 1
            return
        if first.dtype == second.dtype and first.tobytes() == second.tobytes():
            return
        self.differing += 1
        different = np.flatnonzero(_bits(first) != _bits(second))
        with np.errstate(invalid="ignore"):
            gaps = np.abs(first.astype(float) - second.astype(float))[different]
        gaps = np.where(np.isnan(gaps), np.inf, gaps)
        worst = int(np.argmax(gaps))
        self.first = self.first or Place(key, int(different[0]), float(gaps[0]))
        self.gaps[tolerance] = max(float(gaps[worst]), self.gaps.get(tolerance, 0.0))
        if self.most is None or gaps[worst] > self.largest:
            self.most = Place(key, int(different[worst]), float(gaps[worst]))


class Differences:
    """Differences of two runs, collected step by step.

    Args:
        scene: scene of the first run; `bound_difference` uses its tolerance, size, shortest edge and stiffness.

    Attributes:
        fields: dict from topic and field to their difference, in the order of occurrence.
        steps: number of steps compared.
        unmatched: dict from topic to the number of steps in which only one of the runs has it.
    """

    def __init__(self, scene: Scene) -> None:
        self._size, self._tolerance = scene.mesh.size, scene.solver.tolerance
        self._open = self._tolerance
        self._gain = scene.mesh.size / float(scene.mesh.edge_lengths.min())
        low, high = scene.mesh.bounds
        self._young = max(material.young0 for material in scene.materials.values())
        self._axial = self._young * float(np.prod(high - low)) / scene.mesh.size
        self.fields: dict[tuple[str, str], FieldDifference] = {}
        self.steps = 0
        self.unmatched: Counter[str] = Counter()

    def add(self, key: StepKey, first: Mapping[str, Values], second: Mapping[str, Values]) -> None:
        """Compare all published arrays of one step."""
        self.steps += 1
        self.unmatched.update(set(first) ^ set(second))
        tolerance = self._find_accuracy(first.get(RECORD, {}))
        for topic in first:
            if topic in second:
                self._add_topic(key, topic, first[topic], second[topic], tolerance)

    def _find_accuracy(self, record: Values) -> float:
        """Return a step's accuracy: the tolerance if it converged, else the largest estimate since a converged step."""
        if "converged" not in record or record["converged"].item():
            self._open = self._tolerance
        else:
            estimate = float(record["error_estimate"].item())
            self._open = max(self._open, estimate if np.isfinite(estimate) else CUT * self._tolerance)
        return self._open

    def _add_topic(self, key: StepKey, topic: str, first: Values, second: Values, tolerance: float) -> None:
        for name in (*first, *(name for name in second if name not in first)):
            entry = self.fields.setdefault((topic, name), FieldDifference(topic=topic, field=name))
            none = np.zeros(0)
            entry.add(key, first.get(name, none), second.get(name, none), tolerance=tolerance)

    @property
    def differing(self) -> list[FieldDifference]:
        """Fields that are not bit-identical, in the order of their first difference."""
        found = [entry for entry in self.fields.values() if entry.differing]
        return sorted(found, key=lambda entry: entry.first.key if entry.first else (-1, 0))

    @property
    def compared(self) -> int:
        """Number of arrays compared."""
        return sum(entry.compared for entry in self.fields.values())

    def bound_difference(self, entry: FieldDifference, factor: float, tolerance: float | None = None) -> float:
        """Return the largest difference that an error of ``factor`` tolerances can cause, in the unit of the field.

        ``tolerance`` is the accuracy of the step: the solver's tolerance, or the largest error estimate of the first
        run since its last converged step. Errors accumulate in steps that did not converge, e.g. because of a deadline.
        None means the largest accuracy value at which the field differs. Convergence of the second run does not matter.

        The tolerance is a displacement error divided by the body's size. Lengths may differ by this displacement.
        Strains may differ by this displacement divided by the shortest edge. Moduli, energies and forces may differ by
        that strain times the largest magnitude of the field. For an energy density W, the limit is at least that strain
        times sqrt(2 W times Young's modulus). For a force, the limit is at least Young's modulus times the mean cross
        section times the tolerance; for a moment, at least this force times the body's size.

        One unit in the last place of float32 is added, because many fields are published as float32. Some fields may
        differ by any amount. Iterations, substeps, error estimates and skipped work are the cost of a solve, not its
        result. The convergence of a step may differ if its accuracy is worse than the solver's tolerance. Velocities of
        joint states are differences of positions, and positions are compared. Contact points with negligible forces may
        be missing in one run, so that the rows of all other points are shifted. Wrenches contain the contact forces and
        are compared.
        """
        if entry.topic == CONTACTS:
            return np.inf
        if (entry.topic == RECORD and entry.field.startswith(_COSTS)) or entry.field == "velocity":
            return np.inf
        tolerance = max(entry.gaps, default=self._tolerance) if tolerance is None else tolerance
        if entry.field == "converged" and tolerance > self._tolerance:
            return np.inf
        scale = self._scale(entry)
        rounding = float(np.finfo(np.float32).eps) * entry.scale
        return factor * tolerance * scale + rounding if factor > 0.0 else rounding

    def verdict(self, factor: float = 0.0) -> Difference:
        """Return the verdict; with ``factor`` > 0, differences up to ``factor`` solver tolerances are allowed."""
        if not self.differing and not self.unmatched:
            return Difference.IDENTICAL
        within = factor > 0.0 and self.factor_needed() <= factor
        return Difference.WITHIN if within else Difference.DIFFERENT

    def factor_needed(self) -> float:
        """Return the smallest factor with which all differences are allowed; infinite if no factor is large enough."""
        if self.unmatched:
            return np.inf
        return max((self._factor_of(entry) for entry in self.differing), default=0.0)

    def _factor_of(self, entry: FieldDifference) -> float:
        needed = 0.0
        if entry.resized and self.bound_difference(entry, 1.0) < np.inf:
            return np.inf
        for tolerance, gap in entry.gaps.items():
            rounding = self.bound_difference(entry, 0.0, tolerance)
            share = self.bound_difference(entry, 1.0, tolerance) - rounding
            if gap > rounding:
                needed = max(needed, (gap - rounding) / share if share > 0.0 else np.inf)
        return needed

    def _scale(self, entry: FieldDifference) -> float:
        if entry.field in LENGTHS or ".position." in entry.field:
            return self._size
        if entry.field in _RATIOS or ".orientation." in entry.field:
            return self._gain
        scale = self._gain * max(other.scale for other in self._kin(entry))
        if entry.field == "energy_density":  # W = E eps^2 / 2 changes by sqrt(2 E W) with a strain
            return max(scale, self._gain * float(np.sqrt(2.0 * self._young * entry.scale)))
        if ".force." in entry.field or entry.field == "effort":
            return max(scale, self._axial)
        return max(scale, self._axial * self._size) if ".torque." in entry.field else scale

    def _kin(self, entry: FieldDifference) -> Iterator[FieldDifference]:
        """Yield the field and the other components of its vector, because a component that stays zero has no scale."""
        stem = entry.field.rpartition(".")[0]
        vector = VELOCITIES if entry.field in VELOCITIES else ()
        for other in self.fields.values():
            kin = other is entry or other.field in vector or (stem and other.field.startswith(f"{stem}."))
            if other.topic == entry.topic and kin:
                yield other


def _bits(values: NDArray[Any]) -> NDArray[np.unsignedinteger]:
    """Return the bits of numbers converted to double: NaN equals NaN, and 0 differs from -0."""
    return np.ascontiguousarray(values, dtype=np.float64).view(np.uint64)


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
    pairs = zip(*((step for step in source if step.key in common) for source in steps), strict=True)
    waiting: tuple[dict[StepKey, BagStep], dict[StepKey, BagStep]] = {}, {}
    # A reset sets stamps back, so the second bag may have the same keys in another order.
    for pair in pairs:
        for side, step in enumerate(pair):
            waiting[side][step.key] = step
        for key in waiting[0].keys() & waiting[1].keys():
            differences.add(key, waiting[0].pop(key).samples, waiting[1].pop(key).samples)
    only = len(keys[0]) - len(common), len(keys[1]) - len(common)
    return Comparison(differences, only, (steps[0].foreign, steps[1].foreign), _scene_changes(*runs))


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
