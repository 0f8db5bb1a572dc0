# SPDX-License-Identifier: Apache-2.0
"""Simulations of recordings with their commands, and derivatives with respect to parameters by finite differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.workers import map_tasks
from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.fitted_parameter import FittedParameter
from gdfe_ros.fitting.recording import Recording
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Simulation

if TYPE_CHECKING:
    from distributed import Client


Task = tuple[Mapping[str, float], Recording, float]
"""Arguments of one simulation: dict from parameter key to value; the recording; the horizon [s]."""
EQUILIBRIA, MOTION = 1e-6, 1e-5
"""Largest solver tolerances in a fit, for equilibria and for motion. Larger tolerances spoil finite differences between
simulations. With 1e-5, the finite difference of an oscillation has an error of 1.5 %.
"""


class NotSimulatedError(GdfeError):
    """Error: a recording cannot be simulated with the given values of the parameters."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Simulated values of each measured quantity.

    Attributes:
        times: (k,) on the simulation's clock [s]; with dynamics, the first time is 0.
        outputs: simulated values (k, d) of each series, in the recording's order.
        not_converged: number of steps that did not converge.
    """

    times: NDArray[np.float64]
    outputs: tuple[NDArray[np.float64], ...]
    not_converged: int = 0

    def move_along(self, change: Trajectory, length: float) -> Trajectory:
        """Return this trajectory plus ``length`` times the trajectory ``change``."""
        pairs = zip(self.outputs, change.outputs, strict=True)
        return Trajectory(self.times, tuple(own + length * other for own, other in pairs), self.not_converged)


class Simulations:
    """Simulates recordings on workers.

    Args:
        text: YAML text of the scene, which needs no other file.
        client: client of the workers (`gdfe_ros.analysis.workers.connect`); None simulates in this process.

    Attributes:
        count: number of simulations so far.
    """

    def __init__(self, text: str, client: Client | None = None) -> None:
        self._text, self._client = text, client
        self.count = 0

    def run(self, tasks: Sequence[Task]) -> list[Trajectory | NotSimulatedError]:
        """Return the trajectory of each task, or the error that prevented it.

        Raises:
            GdfeError: the workers die.
        """
        self.count += len(tasks)
        return map_tasks(self._client, partial(_simulate, self._text), tasks)


def _simulate(text: str, task: Task) -> Trajectory | NotSimulatedError:
    values, recording, horizon = task
    try:
        return simulate(text, values, recording, horizon=horizon)
    except NotSimulatedError as error:
        return NotSimulatedError(str(error))


def simulate(text: str, values: Mapping[str, float], recording: Recording, *, horizon: float = np.inf) -> Trajectory:
    """Simulate a recording.

    Args:
        text: YAML text of the scene, which needs no other file.
        values: dict from key to value of a parameter.
        recording: recording whose commands are simulated and whose quantities are returned.
        horizon: time [s] after which nothing is simulated.

    Raises:
        NotSimulatedError: the scene is invalid with these values, or its elements are inverted.
    """
    try:
        simulation = _start(text, {**recording.overrides, **values}, recording)
        return _run(simulation, recording, horizon)
    except (GdfeError, ValueError, ArithmeticError) as error:
        given = ", ".join(f"{key} = {value:.6g}" for key, value in values.items())
        raise NotSimulatedError(f"recording {recording.name} with {given}: {error}") from error


def _start(text: str, overrides: Mapping[str, Any], recording: Recording) -> Simulation:
    """Return the simulation in the state before its first step."""
    origin = f"of recording {recording.name}"
    scene = scene_from_text(text, origin=origin, overrides=overrides)
    least = min(scene.solver.tolerance, EQUILIBRIA if scene.dynamics is None else MOTION)
    simulation = Simulation(scene_from_text(text, origin=origin, overrides={**overrides, "solver.tolerance": least}))
    if recording.from_equilibrium and scene.dynamics is not None:
        still = {**overrides, "solver.tolerance": least, "dynamics": None}
        rest = Simulation(scene_from_text(text, origin=origin, overrides=still))
        rest.step(recording.schedule.commands[0])
        simulation.set_positions(rest.positions)
    return simulation


def _run(simulation: Simulation, recording: Recording, horizon: float) -> Trajectory:
    schedule, moves = recording.schedule, simulation.scene.dynamics is not None
    observed = [series.observable for series in recording.series]
    times = [0.0] if moves else []
    rows = [[observable.of(simulation)] if moves else [] for observable in observed]
    failed = 0
    for end, command in zip(schedule.times, schedule.commands, strict=True):
        if times and end > horizon:
            break
        result = simulation.step(command, dt=max(float(end) - simulation.time, 0.0))
        if not np.isfinite(result.positions).all() or result.min_det <= 0.0:
            raise NotSimulatedError(f"elements are turned inside out at t = {end:g} s")
        failed += not result.converged
        if times and end <= times[-1]:  # a step without duration: its state replaces the previous one
            for row in (times, *rows):
                row.pop()
        times.append(float(end))
        for row, observable in zip(rows, observed, strict=True):
            row.append(observable.of(simulation))
    return Trajectory(np.array(times), tuple(np.array(row) for row in rows), failed)


STEP = 0.01
"""Largest change of a coordinate u in a finite difference: 1 % of the value if u is a logarithm, else 1 % of the
interval. The relative error of the derivative is about 1 %, plus the solver's tolerance divided by this change.
"""


def trajectory_columns(
    simulations: Simulations,
    recordings: Sequence[Recording],
    parameters: Sequence[FittedParameter],
    values: Sequence[float],
    base: Sequence[Trajectory],
    *,
    horizons: Sequence[float],
) -> list[list[Trajectory]]:
    """Return d(trajectory)/du for each parameter (outer list) and recording, at given values.

    The differences are one-sided, towards the middle of the bounds.

    Args:
        simulations: runs the simulations.
        recordings: recordings to simulate.
        parameters: parameters with the coordinates u.
        values: values of the parameters.
        base: trajectories at these values.
        horizons: for each recording, the time [s] up to which it is simulated.

    Raises:
        NotSimulatedError: the simulation fails for both signs of a change.
    """
    steps = [_step(parameter, value) for parameter, value in zip(parameters, values, strict=True)]
    pairs = list(zip(recordings, horizons, strict=True))
    tasks = [(_change(parameters, values, place, step), *pair) for place, step in enumerate(steps) for pair in pairs]
    results = simulations.run(tasks)
    columns = []
    for place, step in enumerate(steps):
        changed, length = results[place * len(pairs) : (place + 1) * len(pairs)], step
        if any(isinstance(item, NotSimulatedError) for item in changed):
            length = -step
            changed = simulations.run([(_change(parameters, values, place, length), *pair) for pair in pairs])
        columns.append([_quotient(*both, length) for both in zip(require_simulated(changed), base, strict=True)])
    return columns


def require_simulated(results: list[Trajectory | NotSimulatedError]) -> list[Trajectory]:
    """Return the results of simulations; raise the first error among them."""
    for item in results:
        if isinstance(item, NotSimulatedError):
            raise item
    return results


def _step(parameter: FittedParameter, value: float) -> float:
    """Return the change of the coordinate u, towards the middle of the bounds."""
    low, here, high = (parameter.coordinate(each) for each in (parameter.low, value, parameter.high))
    size = min(STEP, 0.25 * (high - low))
    return size if here <= 0.5 * (low + high) else -size


def _change(
    parameters: Sequence[FittedParameter], values: Sequence[float], place: int, step: float
) -> dict[str, float]:
    """Return a dict from key to value, with the coordinate u of the parameter at ``place`` changed by ``step``."""
    given = {parameter.key: value for parameter, value in zip(parameters, values, strict=True)}
    changed = parameters[place]
    given[changed.key] = changed.value(changed.coordinate(values[place]) + step)
    return given


def _quotient(changed: Trajectory, own: Trajectory, step: float) -> Trajectory:
    pairs = zip(changed.outputs, own.outputs, strict=True)
    return Trajectory(own.times, tuple((other - mine) / step for other, mine in pairs))
