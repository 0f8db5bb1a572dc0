# SPDX-License-Identifier: Apache-2.0
"""Derivatives of material points with respect to actuator commands: finite differences of nearby equilibria."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Actuator, Cable, Embedding, Mode
from gdfe_ros.errors import ENDED, GdfeError
from gdfe_ros.materials.table import YOUNG
from gdfe_ros.solver.deadline import Deadline
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.march import March
from gdfe_ros.solver.stepping.stepper import Stepper

TOLERANCE = 1e-8
"""Tolerance of the equilibria that are compared."""
REACH = 1e-3
"""Displacement between the compared equilibria, divided by the body's size; differences have an error of about REACH^2.
"""
NARROW, WIDE = 0.1, 3.0
"""The change of the command is chosen again if the displacement is not between these two multiples of ``REACH``."""
FIRST = 1e-3
"""First change of a command, divided by the width of its range, or by its magnitude if the range is unbounded."""
SMALLEST = 1e-9
"""Displacement that counts as zero, divided by the body's size."""
SIZINGS = 8
"""Number of attempts to find a change of a command that moves the body by about `REACH`."""
KINK = 0.05
"""A kink is suspected, and a smaller step is tried, if the slopes on both sides differ by more than this fraction of
the larger one.
"""
NEARER, REFINEMENTS = 0.1, 2
"""At a suspected kink, the change of the command is multiplied by the first number, at most as many times as the second
number. The difference of the slopes falls by this factor for a smooth response, and stays constant at a kink.
"""


def jacobian(
    stepper: Stepper,
    state: State,
    points: Sequence[Embedding],
    actuators: Sequence[Actuator],
    *,
    interrupted: Callable[[], bool] | None = None,
) -> list[NDArray[np.float64]]:
    """Return d(point)/d(command) of each actuator, (points, 3) each, at the equilibrium ``state``.

    The derivatives are central differences of second order. At the end of a range, or next to a command without
    equilibrium, they are one-sided differences of second order. At a kink, they are one-sided towards the commands at
    which the actuator pulls or pushes more. The computation ends with an error once ``interrupted`` returns True.

    Raises:
        GdfeError: no equilibrium was found on either side of an actuator's command, or it was interrupted.
    """
    deadline = Deadline(interrupted=interrupted) if interrupted else None

    def solve(start: State, commands: Mapping[str, float]) -> March:
        march = stepper.step(start, start.poses, commands, tolerance=TOLERANCE, deadline=deadline)
        if deadline is not None and deadline.passed():
            raise GdfeError(ENDED)
        return march

    present = state
    if state.shapes is None:  # captured shapes depend on history: solving again would be a further step
        present = solve(state, state.commands).state
    return [_Differences(stepper, solve, present, actuator).slope(points) for actuator in actuators]


class _Differences:
    """Finite differences of equilibria with respect to the command of one actuator."""

    def __init__(
        self,
        stepper: Stepper,
        solve: Callable[[State, Mapping[str, float]], March],
        present: State,
        actuator: Actuator,
    ) -> None:
        self._stepper, self._solve, self._present, self._actuator = stepper, solve, present, actuator
        self._command, self._size = present.commands[actuator.name], stepper.body.size
        self._acting = -1.0 if actuator.mode is Mode.LENGTH else 1.0
        self._here = present.positions if present.shapes is None else self._found(0.0)

    def slope(self, points: Sequence[Embedding]) -> NDArray[np.float64]:
        """Return d(point)/d(command) (points, 3); zeros for a grip, whose command is 0 or 1."""
        if self._actuator.mode is Mode.GRIP:
            return np.zeros((sum(len(point.corners) for point in points), 3))
        effort = self._present.summary.actuators[self._actuator.name].effort
        slack = isinstance(self._actuator, Cable) and not effort > 0.0
        step = self._sized(self._acting)
        motion = self._one_sided(self._acting, step) if slack else self._central(step)
        if motion is None:
            raise GdfeError(
                f"actuator {self._actuator.name!r}: no equilibrium was found near its command {self._command!r}; "
                "the body loses its stability there; remedy: step back from it"
            )
        return np.concatenate([point.at(motion) for point in points]) if points else np.zeros((0, 3))

    def _central(self, step: float) -> NDArray[np.float64] | None:
        nearer = step
        for _ in range(REFINEMENTS + 1):
            forward, backward = self._found(nearer), self._found(-nearer)
            both = forward is not None and backward is not None
            if both and not self._kinked(forward, backward):
                return (forward - backward) / (2.0 * nearer)
            nearer *= NEARER
        nearer /= NEARER
        if both:
            return self._one_sided(self._acting, step)
        return self._one_sided(1.0 if backward is None else -1.0, nearer)

    def _kinked(self, forward: NDArray[np.float64], backward: NDArray[np.float64]) -> bool:
        """Return whether the slopes on both sides differ by more than `KINK`."""
        rise, fall = forward - self._here, self._here - backward
        return bool(np.abs(rise - fall).max() > KINK * max(np.abs(rise).max(), np.abs(fall).max()))

    def _one_sided(self, side: float, step: float) -> NDArray[np.float64] | None:
        for sign in (side, -side):
            near, far = self._found(sign * step), self._found(2.0 * sign * step)
            if near is not None and far is not None:
                return sign * (4.0 * near - 3.0 * self._here - far) / (2.0 * step)
        return None

    def _found(self, change: float) -> NDArray[np.float64] | None:
        """Return positions (n, 3) [m] at a changed command; None if it is out of range or has no equilibrium."""
        command, actuator = self._command + change, self._actuator
        if not actuator.low <= command <= actuator.high:
            return None
        commands = {**self._present.commands, actuator.name: command}
        march = self._solve(self._present, commands)
        return march.state.positions if march.reached and not march.inverted else None

    def _sized(self, side: float) -> float:
        """Return the change of a command that moves the body by about `REACH`; only tension and pressure may grow."""
        actuator, width = self._actuator, self._actuator.high - self._actuator.low
        step = FIRST * (width if math.isfinite(width) else max(abs(self._command), self._scale()))
        most = 0.4 * width if math.isfinite(width) else math.inf
        growth = 30.0 if actuator.mode in (Mode.TENSION, Mode.PRESSURE) else 1.0
        for _ in range(SIZINGS):
            found = self._found(side * step)
            found = self._found(-side * step) if found is None else found
            if found is None:
                step *= NEARER
                continue
            moved = np.linalg.norm(found - self._here, axis=1).max() / self._size
            if NARROW * REACH <= moved <= WIDE * REACH:
                break
            wanted = min(step * min(max(REACH / max(moved, SMALLEST), 1e-3), growth), most)
            if wanted == step:
                break
            step = wanted
        return step

    def _scale(self) -> float:
        """Return a first estimate of the magnitude of a command with an unbounded range."""
        neutral, mode = self._stepper.actuation.neutral[self._actuator.name], self._actuator.mode
        if neutral > 0.0 or mode is Mode.SHORTENING:
            return neutral or self._size
        stiffness = float(self._stepper.body.table.parameters[:, YOUNG].min())
        return 0.01 * stiffness * (self._size**2 if mode is Mode.TENSION else 1.0)
