# SPDX-License-Identifier: Apache-2.0
"""The actuators and loads of a body at work: commands in, what acts on the body and its multipliers out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import Actuator, ActuatorState, Cable, Chamber, Growth, Mode
from gdfe_ros.actuators.external import (
    EFFORT,
    LIMIT,
    STIFFNESS,
    TARGET,
    WIDTH,
    External,
    cable_length,
    cable_tension,
    chamber_pressure,
    chamber_volume,
    nothing,
    pull,
    push,
)
from gdfe_ros.actuators.load import Load
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.global_matrix import GlobalMatrix
from gdfe_ros.solver.grown_shape import GrownShape

PENALTY = 10.0
"""Penalty stiffness of a commanded length or volume over the body's own, as the constant matrix sees it: large enough
for few updates, small enough to leave a descent one outlying eigenvalue that its history takes care of."""
LARGEST_INFLATION = 8.0
"""Ratio by which one equilibrium may inflate a chamber of given pressure; beyond it the chamber counts as unstable."""
RUNNING_AWAY = 0.25
"""Share of that limit at which a solve that found no equilibrium counts as running away."""
LOAD_FACTOR = 1.0
"""Command of every load that nobody commands."""


class Actuation:
    """What acts on a body, packed for the kernels.

    Args:
        body: the discretised body.
        actuators: cables, chambers and growths.
        loads: dead loads; each acts with the factor that is its command.
    """

    def __init__(self, body: Body, actuators: Sequence[Actuator] = (), loads: Sequence[Load] = ()) -> None:
        self._body, self.actuators, self.loads = body, tuple(actuators), tuple(loads)
        self._cables = [item for item in self.actuators if isinstance(item, Cable)]
        self._chambers = [item for item in self.actuators if isinstance(item, Chamber)]
        growths = [item for item in self.actuators if isinstance(item, Growth)]
        self.grown = GrownShape(body.shape, body.blocks, growths) if growths else None
        self._forces = [load.forces(body.rest, body.cells) for load in self.loads]
        self.external = self._pack()
        self._rest_length = [cable_length(body.rest, self.external, i) for i in range(len(self._cables))]
        self._rest_volume = [chamber_volume(body.rest, self.external, i) for i in range(len(self._chambers))]
        self.neutral = {item.name: self._neutral(item) for item in self.actuators}
        self.neutral.update({load.name: 0.0 for load in self.loads})
        self.updates = False
        self.reset()

    @property
    def drives(self) -> bool:
        """Tell whether the body has any actuator or load."""
        return self.external.active or self.grown is not None

    def reset(self) -> None:
        """Go back to rest: nothing commanded, no load."""
        self.commands = dict(self.neutral)
        self._kept = np.zeros((2, len(self._cables) + len(self._chambers)))
        self.apply(self.commands, self._body.rest)

    def stiffen(self, matrix: GlobalMatrix) -> None:
        """Give every commanded length and volume a penalty that fits the body's stiffness at rest."""
        rest, external = self._body.rest, self.external
        force = np.zeros_like(rest)
        for i, cable in enumerate(self._cables):
            if cable.mode is not Mode.TENSION:
                force[...] = 0.0
                pull(rest, external, i, 1.0, force)
                elastic = math.isfinite(cable.stiffness)
                external.cable[i, STIFFNESS] = cable.stiffness if elastic else PENALTY / self._yield(matrix, force)
                self.updates = self.updates or not elastic
        for i, chamber in enumerate(self._chambers):
            if chamber.mode is Mode.VOLUME:
                force[...] = 0.0
                push(rest, external, i, 1.0, force)
                external.chamber[i, STIFFNESS] = PENALTY / self._yield(matrix, force)
                self.updates = True

    def apply(self, commands: Mapping[str, float], positions: NDArray[np.float64], *, ratio: float = 0.0) -> None:
        """Set the commands and start the multipliers of the solve that begins at ``positions`` (n, 3) [m].

        Args:
            commands: for every actuator and load.
            positions: start of the solve; energies count from there.
            ratio: how much of the last accepted step the start repeats; the multipliers follow.
        """
        self.commands = dict(commands)
        start = np.maximum(0.0, self._kept[1] + ratio * (self._kept[1] - self._kept[0]))
        for i, cable in enumerate(self._cables):
            command, row = commands[cable.name], self.external.cable[i]
            if cable.mode is Mode.TENSION:
                row[EFFORT], row[TARGET] = command, cable_length(positions, self.external, i)
            else:
                row[EFFORT] = 0.0 if math.isfinite(cable.stiffness) else start[i]
                row[TARGET] = command if cable.mode is Mode.LENGTH else self._rest_length[i] - command
        for i, chamber in enumerate(self._chambers):
            command, row = commands[chamber.name], self.external.chamber[i]
            volume = chamber_volume(positions, self.external, i)
            row[LIMIT] = math.inf
            if chamber.mode is Mode.PRESSURE:
                row[EFFORT], row[TARGET] = command, volume
                row[LIMIT] = LARGEST_INFLATION * max(abs(volume), self._rest_volume[i])
            else:
                follow = self._kept[1] + ratio * (self._kept[1] - self._kept[0])
                row[EFFORT], row[TARGET] = follow[len(self._cables) + i], command
        if self.loads:
            self.external.dead[...] = sum(
                commands[load.name] * force for load, force in zip(self.loads, self._forces, strict=True)
            )
        if self.grown is not None:
            self.grown.apply(commands)

    def update(self, positions: NDArray[np.float64]) -> float:
        """Update the multipliers; return the largest miss of a commanded length or volume over the body's size."""
        external, worst = self.external, 0.0
        for i in range(len(self._cables)):
            row = external.cable[i]
            if row[STIFFNESS] > 0.0 and not math.isfinite(self._cables[i].stiffness):
                length = cable_length(positions, external, i)
                tension = cable_tension(length, row)
                worst = max(worst, abs(tension - row[EFFORT]) / row[STIFFNESS])
                row[EFFORT] = tension
        for i in range(len(self._chambers)):
            row = external.chamber[i]
            if row[STIFFNESS] > 0.0:
                volume = chamber_volume(positions, external, i)
                row[EFFORT] = chamber_pressure(volume, row)
                worst = max(worst, abs(volume - row[TARGET]) / max(abs(row[TARGET]), 1e-30) ** (2.0 / 3.0))
        return worst / self._body.size

    def accept(self) -> None:
        """Keep the multipliers of the last solve as the start of the next."""
        efforts = np.concatenate([self.external.cable[:, EFFORT], self.external.chamber[:, EFFORT]])
        self._kept = np.stack([self._kept[1], efforts])

    def unstable(self, positions: NDArray[np.float64], before: Mapping[str, float] | None = None) -> str:
        """Name the chamber that inflated without bound in the last solve, which did not converge; empty if none did.

        Where the body ran away at the first step, no volume tells: then it is the one whose pressure has risen since
        the commands ``before``.
        """
        for i, chamber in enumerate(self._chambers):
            name = chamber.name
            if before is not None and chamber.mode is Mode.PRESSURE and self.commands[name] > before[name]:
                return name
            limit = self.external.chamber[i, LIMIT]
            volume = chamber_volume(positions, self.external, i)
            if math.isfinite(limit) and not volume <= RUNNING_AWAY * limit:
                return name
        return ""

    def states(self, positions: NDArray[np.float64]) -> dict[str, ActuatorState]:
        """Return the state of every actuator at ``positions`` (n, 3) [m], those of the last solve."""
        return {item.name: self._state(item, positions) for item in self.actuators}

    def potential(self, positions: NDArray[np.float64]) -> tuple[float, dict[str, float]]:
        """Return the potential [J] of what acts at ``positions`` (n, 3) [m], and its slope along every command.

        Zero at rest. Where a length or a volume is commanded it has none, and its slope is the multiplier.
        """
        total, slopes = 0.0, {}
        for load, force in zip(self.loads, self._forces, strict=True):
            slopes[load.name] = -float(np.vdot(force, positions - self._body.rest))
            total += self.commands[load.name] * slopes[load.name]
        for name, state in self.states(positions).items():
            item = next(item for item in self.actuators if item.name == name)
            if item.mode is Mode.TENSION:
                slopes[name] = state.extent - self._rest_length[self._cables.index(item)]
                total += state.effort * slopes[name]
            elif item.mode is Mode.PRESSURE:
                slopes[name] = self._rest_volume[self._chambers.index(item)] - state.extent
                total += state.effort * slopes[name]
            elif item.mode is not Mode.GROWTH:
                slopes[name] = state.effort if item.mode in (Mode.SHORTENING, Mode.VOLUME) else -state.effort
            if isinstance(item, Cable) and math.isfinite(item.stiffness):
                total += 0.5 * state.effort**2 / item.stiffness
        return total, slopes

    def _state(self, item: Actuator, positions: NDArray[np.float64]) -> ActuatorState:
        command = self.commands[item.name]
        if isinstance(item, Growth):
            return ActuatorState(item.mode, command, self.grown.volume_ratio(item), 0.0)
        if isinstance(item, Cable):
            i = self._cables.index(item)
            row, extent = self.external.cable[i], cable_length(positions, self.external, i)
            effort = cable_tension(extent, row) if math.isfinite(item.stiffness) else row[EFFORT]
        else:
            i = self._chambers.index(item)
            row, extent = self.external.chamber[i], chamber_volume(positions, self.external, i)
            effort = row[EFFORT]
        return ActuatorState(item.mode, command, float(extent), float(effort))

    def _neutral(self, item: Actuator) -> float:
        if item.mode is Mode.LENGTH:
            return self._rest_length[self._cables.index(item)]
        return self._rest_volume[self._chambers.index(item)] if item.mode is Mode.VOLUME else 0.0

    def _yield(self, matrix: GlobalMatrix, force: NDArray[np.float64]) -> float:
        """Return by how much a unit effort with these vertex forces (n, 3) shortens the cable or fills the chamber."""
        right = np.ascontiguousarray(force[self._body.unknowns.free])
        out = np.zeros_like(right)
        matrix.solve(right, out)
        return max(float(np.vdot(right, out)), 1e-300)

    def _pack(self) -> External:
        if not (self._cables or self._chambers or self.loads):
            return nothing()
        empty = nothing()
        points = [cable.points for cable in self._cables]
        quads = [chamber.quads for chamber in self._chambers]
        dead = np.zeros_like(self._body.rest) if self.loads else empty.dead
        return External(
            dead,
            self._body.rest.copy() if self.loads else empty.rest,
            np.cumsum([0, *(len(item.weights) for item in points)], dtype=np.int32),
            np.ascontiguousarray(np.concatenate([empty.corners, *(item.corners for item in points)]), dtype=np.int32),
            np.ascontiguousarray(np.concatenate([empty.weights, *(item.weights for item in points)])),
            np.zeros((len(points), WIDTH)),
            np.cumsum([0, *(len(item) for item in quads)], dtype=np.int32),
            np.ascontiguousarray(np.concatenate([empty.quads, *quads]), dtype=np.int32),
            np.zeros((len(quads), WIDTH)),
        )


def inflated(name: str, last: Mapping[str, float], commands: Mapping[str, float]) -> str:
    """Say that a chamber lost its stability between two pressures."""
    return (
        f"chamber {name!r} lost its stability between {last[name]:.6g} and {commands[name]:.6g} Pa: it would inflate "
        "without bound; command its volume instead to go on, or stiffen its walls"
    )
