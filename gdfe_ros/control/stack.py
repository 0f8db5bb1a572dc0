# SPDX-License-Identifier: Apache-2.0
"""Stacked errors and derivatives of several targets, each divided by the target's tolerance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.control.targets import Aim, Target
from gdfe_ros.errors import CommandError
from gdfe_ros.simulation import Simulation

Array = NDArray[np.float64]
USUAL = 1e-3
"""Default tolerance of orientations [rad] and of forces [N]."""


class Stack:
    """The targets of a simulation, as one vector of errors with one Jacobian.

    Errors and derivatives have m rows, one for each axis of each target. Each row is divided by the target's tolerance
    and multiplied by the square root of its weight.

    Args:
        simulation: the model.
        targets: targets; a probe's name means its position along all axes.
        tolerance: tolerance of positions [m].

    Attributes:
        targets: targets (t,).
        tolerances: tolerances (t,) in the unit of each target.

    Raises:
        CommandError: the scene lacks the probe, obstacle or handle of a target, or there is no target.
    """

    def __init__(self, simulation: Simulation, targets: Sequence[Aim | str], tolerance: float) -> None:
        self.targets = tuple(each if isinstance(each, Aim) else Target(probe=each) for each in targets)
        if not self.targets:
            raise CommandError("inverse control needs a target")
        for target in self.targets:
            target.require_in(simulation.scene)
        usual = [tolerance if isinstance(target, Target) else USUAL for target in self.targets]
        self.tolerances = np.array([t.tolerance or other for t, other in zip(self.targets, usual, strict=True)])
        self._simulation = simulation
        self._scales = [np.sqrt(t.weight) / size for t, size in zip(self.targets, self.tolerances, strict=True)]
        self._ends = np.cumsum([len(target.axes) for target in self.targets])[:-1]

    def check_goals(self, goals: ArrayLike, what: str = "goals") -> Array:
        """Return ``goals`` as an array (t, 3) after a check.

        Args:
            goals: values of all targets.
            what: name of the values in an error.

        Raises:
            CommandError: the shape is wrong, or a value is not finite.
        """
        wanted = np.asarray(goals, dtype=np.float64)
        if wanted.shape != (len(self.targets), 3) or not np.isfinite(wanted).all():
            raise CommandError(f"{what} must be finite and of shape {(len(self.targets), 3)}, got {wanted.tolist()}")
        return wanted

    def values(self) -> Array:
        """Return the present values of the targets (t, 3), each in its unit."""
        return np.array([target.value(self._simulation) for target in self.targets])

    def errors(self, goals: Array, values: Array) -> Array:
        """Return the scaled errors (m,): the differences between goals (t, 3) and values (t, 3)."""
        parts = []
        for target, scale, goal, value in zip(self.targets, self._scales, goals, values, strict=True):
            parts.append(scale * target.missing(goal, value)[list(target.axes)])
        return np.concatenate(parts)

    def jacobian(self, actuators: Sequence[str]) -> Array:
        """Return the exact Jacobian (m, n) of the scaled targets with respect to the commands of actuators.

        Raises:
            GdfeError: the state has no derivatives, e.g. because it is a saddle.
        """
        outputs = list(dict.fromkeys(target.output for target in self.targets))
        found = self._simulation.sensitivities(outputs, [f"actuators.{name}" for name in actuators]).values
        parts = [
            scale * target.derivative(self._simulation, found[target.output])[list(target.axes)]
            for target, scale in zip(self.targets, self._scales, strict=True)
        ]
        return np.concatenate(parts)

    def distances(self, error: Array) -> Array:
        """Return the distances (t,) from the goals, in the unit of each target, for scaled errors (m,)."""
        parts = zip(self._scales, np.split(error, self._ends), strict=True)
        return np.array([np.linalg.norm(part) / scale for scale, part in parts])

    def has_reached(self, error: Array) -> bool:
        """Return whether all targets are within their tolerances, for scaled errors (m,)."""
        return bool((self.distances(error) <= self.tolerances).all())

    def length(self, goals: Array, values: Array) -> float:
        """Return the largest distance from values to goals (t, 3); each distance is divided by `Aim.longest`."""
        longest = [
            target.longest(self._simulation, goal, value)
            for target, goal, value in zip(self.targets, goals, values, strict=True)
        ]
        return float((self.distances(self.errors(goals, values)) / longest).max())

    def message(self, error: Array, values: Array, ended: Sequence[str]) -> str:
        """Return a message that states the distances from missed goals and the reasons; empty if all are reached.

        Args:
            error: scaled errors (m,).
            values: values of the targets (t, 3).
            ended: names of the actuators whose command is at an end of its range.
        """
        distances = self.distances(error)
        far = [number for number, distance in enumerate(distances) if distance > self.tolerances[number]]
        if not far:
            return ""
        named = [f"{self.targets[i].name} {distances[i]:.3g} {self.targets[i].unit}" for i in far]
        parts = [f"nearest point so far, from the goal: {', '.join(named)}"]
        parts += [text for i in far if (text := self.targets[i].obstacle(self._simulation, values[i]))]
        parts += [f"at the end of their range: {', '.join(ended)}"] if ended else []
        return "; ".join(parts)
