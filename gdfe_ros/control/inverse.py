# SPDX-License-Identifier: Apache-2.0
"""Commands that bring probes to where they are to be: Gauss and Newton's method on the model, within bounds.

Each change of the commands is the solution of a quadratic programme,

    min  sum_i w_i |J_i dc - e_i|^2 + l^2 |D dc|^2    with  low <= c + dc <= high,  |dc| <= rate dt,

with the exact Jacobians J of the probes (docs/sensitivities.md), their distances e from the goals and the priorities w.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.actuators import Cable, Mode
from gdfe_ros.control.programme import least_squares
from gdfe_ros.errors import CommandError
from gdfe_ros.simulation import Command, Simulation

Array = NDArray[np.float64]
LEAST = 1e-4
"""Weight of a change of the commands itself, over what it moves."""
TRUST, SHORTER, LONGER = 0.1, 0.25, 2.0
"""Longest way of the probes in a change, over the body's size; by how much it shrinks where a change did not lead
nearer, and grows where it did."""
ROUNDING = 1e-9
"""Share of a change that is none."""
MOST_TRIES = 60
"""Changes of the commands after which a goal counts as out of reach."""
STANDSTILL, FAINT = 0.1, 1e-3
"""Shares of the tolerance by which a change that is worth a step moves probes, and leads them nearer."""


@dataclass(frozen=True, kw_only=True)
class Target:
    """Where a probe is to be.

    Attributes:
        probe: its name.
        axes: which of x, y, z count, by number.
        weight: priority beside other targets: errors count by its root.

    Raises:
        ValueError: an axis is none, or the weight is not positive.
    """

    probe: str
    axes: tuple[int, ...] = (0, 1, 2)
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not self.axes or not set(self.axes) <= {0, 1, 2}:
            raise ValueError(f"axes of target {self.probe!r} must be some of 0, 1, 2, got {self.axes!r}")
        if not 0.0 < self.weight < np.inf:
            raise ValueError(f"the weight of target {self.probe!r} must be positive and finite, got {self.weight!r}")


@dataclass(frozen=True, eq=False, kw_only=True)
class Reach:
    """How near probes came to their goals.

    Attributes:
        commands: by actuator.
        distances: (t,) [m] of each target from its goal, along its axes.
        reached: all are within the tolerance.
        message: what was in the way; empty where nothing was.
        tries: changes of the commands that were tried.
    """

    commands: Mapping[str, float]
    distances: Array
    reached: bool
    message: str
    tries: int


class InverseControl:
    """Moves actuators such that probes of a simulation go where they are told.

    Tensions stay non-negative and all commands within the scene's ranges; rates of the scene hold for each `move`.

    Args:
        simulation: the model; without dynamics each command is its equilibrium.
        targets: what is to be where; names alone take all axes.
        actuators: names; None takes all.
        tolerance: distance [m] at which a goal counts as reached.

    Raises:
        CommandError: no such probe or actuator, dynamics, or a tolerance that is not positive.

    Example:
        >>> control = InverseControl(Simulation(load_scene("tendon_finger")), [Target(probe="tip", axes=(0, 2))])
        >>> control.reach([[0.098, 0.0, -0.013]]).reached
        True
    """

    def __init__(
        self,
        simulation: Simulation,
        targets: Sequence[Target | str],
        *,
        actuators: Sequence[str] | None = None,
        tolerance: float = 1e-5,
    ) -> None:
        scene = simulation.scene
        if scene.dynamics is not None:
            raise CommandError("inverse control goes from equilibrium to equilibrium; remedy: a scene without dynamics")
        if not 0.0 < tolerance < np.inf:
            raise CommandError(f"the tolerance of inverse control must be positive [m], got {tolerance!r}")
        known = {actuator.name: actuator for actuator in scene.actuators}
        self.names = tuple(known if actuators is None else actuators)
        for name in self.names:
            if name not in known:
                raise CommandError(f"no actuator {name!r} in scene {scene.name!r}; actuators: {', '.join(known)}")
        if not (self.names and targets):
            raise CommandError("inverse control needs an actuator and a target")
        self.targets = tuple(each if isinstance(each, Target) else Target(probe=each) for each in targets)
        for target in self.targets:
            if target.probe not in scene.probes:
                raise CommandError(f"no probe {target.probe!r}; probes: {', '.join(scene.probes) or 'none'}")
        self.simulation, self.tolerance = simulation, tolerance
        chosen = [known[name] for name in self.names]
        pulls = [isinstance(each, Cable) and each.mode is Mode.TENSION for each in chosen]
        lows = [max(each.low, 0.0) if pull else each.low for each, pull in zip(chosen, pulls, strict=True)]
        self._low = np.array(lows)
        self._high = np.array([each.high for each in chosen])
        self._rates = np.array([each.rate for each in chosen])
        self._trust = TRUST * scene.mesh.size

    def reach(self, goals: ArrayLike) -> Reach:
        """Bring the probes to their goals, or as near as they get, whatever time that takes.

        Where goals are out of reach, the commands are those of the nearest point, and the message says so.

        Args:
            goals: (t, 3) [m], one row for each target.

        Raises:
            CommandError: their shape is another, or a value is not finite; the state is unchanged.
        """
        wanted, tries, stuck = self._checked(goals), 0, False
        if not self.simulation.settled:
            self.simulation.step()
        error = self._errors(wanted)
        while tries < MOST_TRIES and not stuck and self._far(error):
            moved, error, spent = self._nearer(wanted, error, np.full(len(self.names), np.inf))
            tries, stuck = tries + spent, not moved
        return self._told(error, tries)

    def move(self, goals: ArrayLike, dt: float) -> Reach:
        """Make one change of the commands towards the goals, as far as rates allow in ``dt`` [s]: a step of a loop.

        Args:
            goals: (t, 3) [m], one row for each target.
            dt: time of the step [s].

        Raises:
            CommandError: goals or time are not allowed; the state is unchanged.
        """
        wanted = self._checked(goals)
        if not 0.0 < dt < np.inf:
            raise CommandError(f"a move takes a positive time [s], got {dt!r}")
        if not self.simulation.settled:
            self.simulation.step()
        error, tries = self._errors(wanted), 0
        if self._far(error):
            _, error, tries = self._nearer(wanted, error, self._rates * dt, dt=dt)
        return self._told(error, tries)

    def _nearer(self, wanted: Array, error: Array, reach: Array, dt: float | None = None) -> tuple[bool, Array, int]:
        """Change the commands once; return whether that led nearer, the errors then, and how often it was tried."""
        here, tries = self.simulation.snapshot(), 0
        now = np.array([self.simulation.commands[name] for name in self.names])
        rows = self._rows()
        low, high = np.maximum(self._low - now, -reach), np.minimum(self._high - now, reach)
        while tries < MOST_TRIES:
            tries += 1
            length = float(np.linalg.norm(error))
            goal = error * min(1.0, self._trust / length)
            change = least_squares(rows, goal, low, high, least=LEAST)
            gain = length - float(np.linalg.norm(error - rows @ change))
            if np.linalg.norm(rows @ change) < STANDSTILL * self.tolerance or gain < FAINT * self.tolerance:
                break
            values = self._ranged(now + change, ROUNDING * np.abs(change)).tolist()
            result = self.simulation.step(Command(actuators=dict(zip(self.names, values, strict=True))), dt=dt)
            after = self._errors(wanted)
            if result.converged and length - float(np.linalg.norm(after)) > 0.25 * gain:
                self._trust = min(TRUST * self.simulation.mesh.size, LONGER * self._trust)
                return True, after, tries
            self.simulation.restore(here)
            self._trust = SHORTER * min(self._trust, length)
            if self._trust < self.tolerance:
                break
        self._trust = TRUST * self.simulation.mesh.size
        return False, error, tries

    def _ranged(self, commands: Array, rounding: Array) -> Array:
        """Return commands (n,) within their ranges, and at an end of one where only rounding (n,) keeps them off it."""
        commands = np.where(np.abs(commands - self._low) <= rounding, self._low, commands)
        commands = np.where(np.abs(commands - self._high) <= rounding, self._high, commands)
        return np.clip(commands, self._low, self._high)

    def _checked(self, goals: ArrayLike) -> Array:
        wanted = np.asarray(goals, dtype=np.float64)
        if wanted.shape != (len(self.targets), 3) or not np.isfinite(wanted).all():
            raise CommandError(f"goals must be finite and of shape {(len(self.targets), 3)}, got {wanted.tolist()}")
        return wanted

    def _errors(self, wanted: Array) -> Array:
        """Return how far targets are from their goals along their axes, times the roots of their weights."""
        places = self.simulation.probe_positions()
        parts = []
        for target, goal in zip(self.targets, wanted, strict=True):
            axes = list(target.axes)
            parts.append(np.sqrt(target.weight) * (goal - places[target.probe])[axes])
        return np.concatenate(parts)

    def _rows(self) -> Array:
        """Return the Jacobian in the same rows."""
        found = self.simulation.jacobian([target.probe for target in self.targets], self.names)
        parts = [
            np.sqrt(target.weight) * each[list(target.axes)] for target, each in zip(self.targets, found, strict=True)
        ]
        return np.concatenate(parts)

    def _distances(self, error: Array) -> Array:
        ends = np.cumsum([len(target.axes) for target in self.targets])[:-1]
        parts = zip(self.targets, np.split(error, ends), strict=True)
        return np.array([np.linalg.norm(part) / np.sqrt(target.weight) for target, part in parts])

    def _far(self, error: Array) -> bool:
        return bool((self._distances(error) > self.tolerance).any())

    def _told(self, error: Array, tries: int) -> Reach:
        distances, commands = self._distances(error), {name: self.simulation.commands[name] for name in self.names}
        reached, message = bool((distances <= self.tolerance).all()), ""
        if not reached:
            ends = [
                name
                for name, low, high in zip(self.names, self._low, self._high, strict=True)
                if not low < commands[name] < high
            ]
            far = ", ".join(
                f"{target.probe} {distance:.3g} m"
                for target, distance in zip(self.targets, distances, strict=True)
                if distance > self.tolerance
            )
            message = f"nearest point so far, from the goal: {far}"
            message += f"; at the end of their range: {', '.join(ends)}" if ends else ""
        return Reach(commands=commands, distances=distances, reached=reached, message=message, tries=tries)
