# SPDX-License-Identifier: Apache-2.0
"""Derivatives of simulated recordings with respect to the parameters, by finite differences.

The fit calls only `trajectory_columns`; exact columns by implicit differentiation could replace it.
"""

from __future__ import annotations

from collections.abc import Sequence

from gdfe_ros.fitting.parameter import FittedParameter
from gdfe_ros.fitting.recording import Recording
from gdfe_ros.fitting.trajectory import NotSimulatedError, Simulator, Trajectory

STEP = 0.01
"""Largest change of a coordinate u in a finite difference: 1 % of the value if u is a logarithm, else 1 % of the
interval. The relative error of the derivative is about 1 %, plus the solver's tolerance divided by this change.
"""


def trajectory_columns(
    simulator: Simulator,
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
        simulator: runs the simulations.
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
    tasks = [(_changed(parameters, values, place, step), *pair) for place, step in enumerate(steps) for pair in pairs]
    results = simulator.run(tasks)
    columns = []
    for place, step in enumerate(steps):
        changed, length = results[place * len(pairs) : (place + 1) * len(pairs)], step
        if any(isinstance(item, NotSimulatedError) for item in changed):
            length = -step
            changed = simulator.run([(_changed(parameters, values, place, length), *pair) for pair in pairs])
        for item in changed:
            if isinstance(item, NotSimulatedError):
                raise item
        columns.append([_quotient(item, own, length) for item, own in zip(changed, base, strict=True)])
    return columns


def _step(parameter: FittedParameter, value: float) -> float:
    """Return the change of the coordinate u, towards the middle of the bounds."""
    low, here, high = (parameter.coordinate(each) for each in (parameter.low, value, parameter.high))
    size = min(STEP, 0.25 * (high - low))
    return size if here <= 0.5 * (low + high) else -size


def _changed(
    parameters: Sequence[FittedParameter], values: Sequence[float], place: int, step: float
) -> dict[str, float]:
    """Return dict from key to value, with the coordinate u of the parameter at ``place`` changed by ``step``."""
    given = {parameter.key: value for parameter, value in zip(parameters, values, strict=True)}
    changed = parameters[place]
    given[changed.key] = changed.value(changed.coordinate(values[place]) + step)
    return given


def _quotient(changed: Trajectory, own: Trajectory, step: float) -> Trajectory:
    pairs = zip(changed.outputs, own.outputs, strict=True)
    return Trajectory(own.times, tuple((other - mine) / step for other, mine in pairs))
