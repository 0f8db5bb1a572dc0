# SPDX-License-Identifier: Apache-2.0
"""How material points move with the commands of actuators: differences of equilibria near the present one."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Actuator, ActuatorState, Cable, Embedding, Mode
from gdfe_ros.materials.table import YOUNG
from gdfe_ros.solver.engine import Engine

TOLERANCE = 1e-8
"""Of the equilibria that are compared."""
REACH = 1e-3
"""Displacement, over the body's size, by which they differ: the error of a difference is about its square."""
NARROW, WIDE = 0.1, 3.0
"""The step is chosen anew where the displacement lies outside of these multiples of ``REACH``."""
FIRST = 1e-3
SMALLEST = 1e-9
SIZINGS = 8


def central_differences(
    engine: Engine, points: Sequence[Embedding], actuators: Sequence[Actuator]
) -> list[NDArray[np.float64]]:
    """Return d(point)/d(command) of each actuator, (points, 3) each; the engine keeps its state.

    Second-order one-sided differences where the range ends, and towards a taut cable where it is slack.
    """
    present = engine.branch(TOLERANCE)
    _advance(present, present.commands)
    return [_column(present, points, actuator) for actuator in actuators]


def _column(present: Engine, points: Sequence[Embedding], actuator: Actuator) -> NDArray[np.float64]:
    command = present.commands[actuator.name]
    state = present.actuation.states(present.positions)[actuator.name]
    side = _side(actuator, state)

    def found(change: float) -> NDArray[np.float64]:
        branch = present.branch(TOLERANCE)
        return _advance(branch, {**branch.commands, actuator.name: command + change})

    step = _step(present, found, actuator, command, side or 1.0)
    if side == 0.0 and actuator.low <= command - step and command + step <= actuator.high:
        slope = (found(step) - found(-step)) / (2.0 * step)
    else:
        if side == 0.0:
            side = 1.0 if command + 2.0 * step <= actuator.high else -1.0
        near, far = found(side * step), found(2.0 * side * step)
        slope = side * (4.0 * near - 3.0 * present.positions - far) / (2.0 * step)
    return np.concatenate([point.at(slope) for point in points]) if points else np.zeros((0, 3))


def _side(actuator: Actuator, state: ActuatorState) -> float:
    """Return the side on which a slack cable becomes taut; 0 where both sides are smooth."""
    if not isinstance(actuator, Cable) or state.effort > 0.0:
        return 0.0
    return -1.0 if actuator.mode is Mode.LENGTH else 1.0


def _step(
    present: Engine,
    found: Callable[[float], NDArray[np.float64]],
    actuator: Actuator,
    command: float,
    side: float,
) -> float:
    """Choose the change of a command that moves the body by about ``REACH``; a geometric one is not enlarged."""
    width = actuator.high - actuator.low
    step = FIRST * (width if math.isfinite(width) else max(abs(command), _scale(present, actuator)))
    most = 0.4 * width if math.isfinite(width) else math.inf
    if command + side * step > actuator.high:
        side = -1.0
    growth = 30.0 if actuator.mode in (Mode.TENSION, Mode.PRESSURE) else 1.0
    for _ in range(SIZINGS):
        moved = np.linalg.norm(found(side * step) - present.positions, axis=1).max() / present.body.size
        if NARROW * REACH <= moved <= WIDE * REACH:
            break
        wanted = min(step * min(max(REACH / max(moved, SMALLEST), 1e-3), growth), most)
        if wanted == step:
            break
        step = wanted
    return step


def _scale(present: Engine, actuator: Actuator) -> float:
    """Return a first guess of the size of a command whose range has no end."""
    neutral = present.actuation.neutral[actuator.name]
    if neutral > 0.0 or actuator.mode is Mode.SHORTENING:
        return neutral or present.body.size
    stiffness = float(present.body.table.parameters[:, YOUNG].min())
    return 0.01 * stiffness * (present.body.size**2 if actuator.mode is Mode.TENSION else 1.0)


def _advance(engine: Engine, commands: dict[str, float]) -> NDArray[np.float64]:
    now = time.perf_counter()
    return engine.step(engine.poses, commands, moment=0.0, started=now).positions
