# SPDX-License-Identifier: Apache-2.0
"""Time series of a run: numbers for each command, response and cost, energies, and histograms of strain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.bag_run import CONTACTS, JOINTS, RECORD, BagStep
from gdfe_ros.analysis.message_values import Values
from gdfe_ros.recording.step import Begin

HAS = "kinetic + elastic + potential"
EXPECTED = "start + work - dissipated"
DIFFERENCE = "difference"
SIZES = {"kinetic": "kinetic energy", "elastic": "elastic energy", "work": "work"}
"""Dict from energy to its name in texts. The error of the balance is compared with the largest of these energies."""


def energy_balance(history: RunHistory) -> dict[str, NDArray[np.float64]]:
    """Return both sides of the energy balance and their difference at each step [J]; empty without dynamics.

    The difference is the energy created or lost by the time integration. It is zero at the beginning of the recording,
    and at each step that starts from a reset or a loaded state.
    """
    if not history.energies:
        return {}
    energy = {name: np.array(values) for name, values in history.energies.items()}
    has = energy["kinetic"] + energy["elastic"] + energy["potential"]
    put = energy["work"] - energy["dissipated"]
    steps = np.arange(len(has))
    starts = np.union1d(0, history.starts).astype(int)
    first = starts[np.searchsorted(starts, steps, side="right") - 1]
    expected = (has - put)[first] + put
    return {HAS: has, EXPECTED: expected, DIFFERENCE: has - expected}


def balance_text(history: RunHistory) -> str:
    """Return a text that states the largest error of the energy balance; empty without dynamics."""
    balance = energy_balance(history)
    if not balance:
        return ""
    most = np.nanmax(np.abs(balance[DIFFERENCE]))
    sizes = {name: np.nanmax(np.abs(history.energies[key])) for key, name in SIZES.items()}
    name = max(sizes, key=sizes.get)
    part = f", {100.0 * most / sizes[name]:.2g} % of the largest {name}" if sizes[name] > 0.0 else ""
    return f"closes to {most:.3g} J{part}"


_FINE, _SMALLEST = 2048, 1e-6
"""Number of classes that are counted, and the initial range of strains."""


class StrainHistogram:
    """Histogram of the cells' strains for each group of consecutive steps.

    The largest strain of a run need not be known in advance. If a strain exceeds the range, the range is doubled and
    pairs of classes are merged.

    Args:
        steps: number of steps of the run.
        columns: largest number of groups.
    """

    def __init__(self, steps: int, *, columns: int) -> None:
        self._steps, self._columns = max(1, steps), min(columns, max(1, steps))
        self._counts = np.zeros((self._columns, _FINE))
        self._times = np.full(self._columns, np.nan)
        self._range, self._most = _SMALLEST, 0.0

    def add(self, number: int, time: float, strain: NDArray[np.float32]) -> None:
        """Add the strains (m,) of step ``number`` at ``time`` [s]; values that are not finite are left out."""
        values = strain[np.isfinite(strain)].astype(float)
        if not values.size:
            return
        self._most = max(self._most, float(values.max()))
        while self._most >= self._range:
            self._range *= 2.0
            merged = self._counts.reshape(self._columns, -1, 2).sum(axis=2)
            self._counts = np.hstack([merged, np.zeros_like(merged)])
        column = number * self._columns // self._steps
        places = np.clip(values * (_FINE / self._range), 0, _FINE - 1).astype(np.int64)
        self._counts[column] += np.bincount(places, minlength=_FINE)
        self._times[column] = time

    def shares(self, bins: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the histogram in ``bins`` classes up to the largest strain of the run.

        Returns:
            End of each group (c,) [s], edges of the classes (bins + 1,), and fractions (bins, c) of the cells in each
            class, averaged over each group. c is 0 if no strains were added.
        """
        seen = np.isfinite(self._times)
        edges = np.linspace(0.0, max(self._most, _SMALLEST) * (1.0 + 1e-9), bins + 1)
        middles = (np.arange(_FINE) + 0.5) * self._range / _FINE
        places = np.clip(np.searchsorted(edges, middles, side="right") - 1, 0, bins - 1)
        shares = np.zeros((bins, self._columns))
        np.add.at(shares, places, self._counts.T)
        return self._times[seen], edges, (shares / np.maximum(self._counts.sum(axis=1), 1.0))[:, seen]


COSTS = ("iterations", "substeps", "error_estimate", "wall_time")
REST = (0.0,) * 6


@dataclass(eq=False)
class RunHistory:
    """Series over the steps of a run, collected by ``add``.

    Args:
        strain: histogram to which eps_eq of each step is added.

    Attributes:
        time: simulation time at the end of each step [s].
        simulated: sum of the durations of the steps so far, at the end of each step [s].
        stamps: stamp of each step on the node's clock [s].
        targets: dict from handle to its target at each step: translation [m] and rotation vector [rad], six numbers.
        commands: dict from actuator, load or joint to its command at each step; NaN before the first command.
        costs: dict from cost to its value at each step: ``iterations, substeps, error_estimate, wall_time`` [s] and
            ``skipped.<name>``.
        responses: dict from topic and field to the published number at each step; NaN if it is missing.
        energies: dict from energy to its value at each step [J]; empty for a run without dynamics.
        starts: indices of the steps that do not start from the state of the previous step.
        not_converged: times of the steps that did not converge [s].
        cut: number of steps whose solve was ended by a deadline.
    """

    strain: StrainHistogram
    time: list[float] = field(default_factory=list)
    simulated: list[float] = field(default_factory=list)
    stamps: list[float] = field(default_factory=list)
    targets: dict[str, list[tuple[float, ...]]] = field(default_factory=dict)
    commands: dict[str, list[float]] = field(default_factory=dict)
    costs: dict[str, list[float]] = field(default_factory=dict)
    responses: dict[tuple[str, str], list[float]] = field(default_factory=dict)
    energies: dict[str, list[float]] = field(default_factory=dict)
    starts: list[int] = field(default_factory=list)
    not_converged: list[float] = field(default_factory=list)
    cut: int = 0

    def add(self, step: BagStep) -> None:
        """Add the numbers of one step."""
        record, count = step.record, len(self.time)
        self.time.append(record.time)
        self.simulated.append((self.simulated[-1] if count else 0.0) + record.dt)
        self.stamps.append(1e-9 * record.stamp)
        self._add_commands(step, count)
        costs = {name: float(getattr(record, name)) for name in COSTS}
        costs |= {f"skipped.{name}": float(number) for name, number in record.skipped.items()}
        _extend(self.costs, costs, count, 0.0)
        numbers = {(RECORD, "energy"): record.energy, (RECORD, "min_det"): record.min_det}
        for topic, values in step.samples.items():
            if topic != RECORD:
                numbers |= _numbers(topic, values)
        _extend(self.responses, numbers, count, np.nan)
        _extend(self.energies, record.energies, count, np.nan)
        if record.begin is not Begin.LAST:
            self.starts.append(count)
        strain = step.samples.get("strain", {}).get("eps_eq")
        if strain is not None:
            self.strain.add(count, record.time, strain)
        if not record.converged:
            self.not_converged.append(record.time)
        self.cut += record.cut

    def lateness(self) -> NDArray[np.float64]:
        """Return, for each step, the wall time since the first step minus the simulation time since then [s].

        With ``publish_clock``, or the /clock of another node, stamps are no wall times.
        """
        return (np.array(self.stamps) - self.stamps[0]) - (np.array(self.simulated) - self.simulated[0])

    def _add_commands(self, step: BagStep, count: int) -> None:
        """Add the commands of one step; a command that the step did not consume keeps its last value."""
        for name, pose in step.record.handles.items():
            series = self.targets.setdefault(name, [REST] * count)
            series.append((*pose.translation, *pose.rotation))
        for group in ("actuators", "loads", "joints"):
            for name, value in getattr(step.record, group).items():
                self.commands.setdefault(name, [np.nan] * count).append(float(value))
        for series in (*self.targets.values(), *self.commands.values()):
            if len(series) == count:
                series.append(series[-1])


def _numbers(topic: str, values: Values) -> dict[tuple[str, str], float]:
    """Return the scalars of a message by topic and field; arrays are left out.

    Entries of joint states are scalars with a number in their name, e.g. ``effort.0``. For contacts, the scalars are
    the number of points and the number of slipping points.
    """
    found = {}
    if topic == CONTACTS:
        return {(topic, "points"): float(len(values["x"])), (topic, "slipping"): float(values["slips"].sum())}
    for name, array in values.items():
        if topic == JOINTS:
            found |= {(topic, f"{name}.{place}"): float(value) for place, value in enumerate(array)}
        elif array.size == 1:
            found[topic, name] = float(array[0])
    return found


def _extend(table: dict, values: Mapping, count: int, missing: float) -> None:
    """Append one row. A new series gets ``missing`` for earlier rows; a series without a value gets it in this row."""
    for name, value in values.items():
        table.setdefault(name, [missing] * count).append(value)
    for series in table.values():
        if len(series) == count:
            series.append(missing)
