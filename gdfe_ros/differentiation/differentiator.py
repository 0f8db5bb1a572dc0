# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a running simulation, at equilibria and along motions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gdfe_ros.command import Orders
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import ENDED, CommandError, GdfeError
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.outcome import Deadline
from gdfe_ros.solver.settings import Policy
from gdfe_ros.solver.solution import PathResult
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.stepper import Stepper
from gdfe_ros.solver.vectors import Array

if TYPE_CHECKING:
    from gdfe_ros.differentiation.derivatives import Derivatives, Sensitivities
    from gdfe_ros.solver.sensitivity.motion import Trail

CHANGE, TOLERANCE = 1e-2, 1e-8
"""Change of a growth's command in a difference, and tolerance of the two steps from which the difference is taken."""
Interruption = Callable[[], bool] | None
"""Function that is called repeatedly; if it returns True, an error is raised."""
Names = Sequence[str] | None
"""Names of outputs or parameters; None for a default."""


def make_differentiator(scene: Scene, stepper: Stepper | MotionStepper, orders: Orders) -> Differentiator:
    """Return the differentiator of a scene.

    Args:
        scene: the scene.
        stepper: the stepper of the scene's body.
        orders: names of the scene's probes and actuators.
    """
    if scene.dynamics is not None:
        return MotionDifferentiator(scene, stepper, orders)
    kind = RelativeDifferentiator if scene.solver.policy is Policy.RELATIVE else Differentiator
    return kind(scene, stepper, orders)


class Differentiator:
    """Makes the steps of a simulation, and computes derivatives of its equilibria."""

    def __init__(self, scene: Scene, stepper: Stepper | MotionStepper, orders: Orders) -> None:
        self._scene, self._stepper, self._orders = scene, stepper, orders

    @cached_property
    def derivatives(self) -> Derivatives:
        """Derivatives by name."""
        from gdfe_ros.differentiation.derivatives import Derivatives  # needed here only

        return Derivatives(self._scene, self._stepper)

    def forget(self) -> None:
        """Forget the last step."""

    def step(
        self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float], **given: Any
    ) -> PathResult:
        """Make a step with the arguments of the stepper; update the derivatives if `follow` requested them."""
        return self._stepper.step(state, targets, commands, **given)

    def follow(self, state: State, parameters: Names) -> None:
        """Update derivatives with respect to ``parameters`` in all further steps from ``state``."""
        self._require_rigid_joints()
        if not self.derivatives.choose_parameters(parameters):
            known = ", ".join(self.derivatives.parameters.names)
            raise CommandError(f"nothing to follow; parameters of this scene: {known}")

    def sensitivities(
        self, state: State, outputs: Names, parameters: Names, *, solved: bool, interrupted: Interruption
    ) -> Sensitivities:
        """Return d(output)/d(parameter) at ``state``; ``solved`` is False while the first commands are unsolved."""
        self._require_rigid_joints()
        if not solved:
            raise GdfeError("no derivative: the first commands, as of loads, are not solved yet; remedy: step first")
        return self.derivatives.derive_outputs(state, outputs, parameters, interrupted=interrupted)

    def jacobian(self, state: State, probes: Names, actuators: Names, *, interrupted: Interruption) -> Array:
        """Return d(probe position)/d(command) (probes, 3, actuators) at ``state``; in motion, within the last step."""
        self._require_rigid_joints()
        points = list(self._scene.probes) if probes is None else list(probes)
        names = [each.name for each in self._scene.actuators] if actuators is None else list(actuators)
        self._orders.probes(points)
        for name in names:
            self._orders.actuator(name)
        if not names:
            return np.zeros((len(points), 3, 0))
        return self._jacobian(state, points, names, interrupted)

    def _jacobian(self, state: State, probes: list[str], actuators: list[str], interrupted: Interruption) -> Array:
        outputs, wanted = [f"probes.{name}" for name in probes], [f"actuators.{name}" for name in actuators]
        found = self._derivatives_now(state, outputs, wanted, interrupted)
        return found.matrix.reshape(len(probes), 3, len(actuators))

    def _derivatives_now(
        self, state: State, outputs: Sequence[str], parameters: Sequence[str], interrupted: Interruption
    ) -> Sensitivities:
        """Return d(output)/d(parameter) at ``state``; in motion, only the last step depends on the parameters."""
        return self.derivatives.derive_outputs(state, outputs, parameters, interrupted=interrupted)

    def _require_rigid_joints(self) -> None:
        """Raise `GdfeError` if an arm has yielding joints: derivatives assume that its flange does not move."""
        for arm in self._scene.arms:
            if arm.springs is not None:
                remedy = f"remedy: an arm {arm.name!r} without `compliance`"
                raise GdfeError(f"no derivative: it would leave out the yielding joints of arm {arm.name!r}; {remedy}")


class RelativeDifferentiator(Differentiator):
    """Derivatives of the policy ``relative``, which has no forces: differences of two steps from the present state."""

    def _jacobian(self, state: State, probes: list[str], actuators: list[str], interrupted: Interruption) -> Array:
        points, columns = self._orders.probes(probes), []
        deadline = Deadline(interrupted=interrupted) if interrupted else None
        for growth in map(self._orders.actuator, actuators):
            here = state.commands[growth.name]
            ends, places = (max(growth.low, here - CHANGE), min(growth.high, here + CHANGE)), []
            for command in ends:
                commands = {**state.commands, growth.name: command}
                outcome = self._stepper.step(state, state.poses, commands, tolerance=TOLERANCE, deadline=deadline)
                if deadline is not None and deadline.has_passed():
                    raise GdfeError(ENDED)
                if not outcome.sound:
                    raise GdfeError(f"actuator {growth.name!r}: no equilibrium beside its command: {outcome.message}")
                places.append(
                    np.concatenate([np.zeros((0, 3)), *(point.at(outcome.state.positions) for point in points)])
                )
            columns.append((places[1] - places[0]) / (ends[1] - ends[0]))
        return np.stack(columns, axis=2)


class _Step(NamedTuple):
    """Inputs of a step with dynamics, and the states before and after it."""

    start: State
    found: State
    targets: Mapping[str, Pose]
    commands: Mapping[str, float]
    duration: float


class MotionDifferentiator(Differentiator):
    """Derivatives of a motion: of all steps since `follow`, or of the last step alone, which is then repeated."""

    def __init__(self, scene: Scene, stepper: MotionStepper, orders: Orders) -> None:
        super().__init__(scene, stepper, orders)
        self._trail: Trail | None = None
        self._last: _Step | None = None

    def forget(self) -> None:
        """Forget the last step."""
        self._last = None

    def step(
        self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float], **given: Any
    ) -> PathResult:
        """Make a step with the arguments of the stepper; update the derivatives if `follow` requested them."""
        if self._trail is not None:
            self._trail.begin(state)
            given["observer"] = self._trail.observe
        outcome = super().step(state, targets, commands, **given)
        self._last = _Step(state, outcome.state, targets, commands, given["duration"])
        return outcome

    def follow(self, state: State, parameters: Names) -> None:
        """Update derivatives with respect to ``parameters`` in all further steps from ``state``."""
        super().follow(state, parameters)
        self._trail = self.derivatives.trail(state, parameters)

    def sensitivities(
        self, state: State, outputs: Names, parameters: Names, *, solved: bool, interrupted: Interruption
    ) -> Sensitivities:
        """Return d(output)/d(parameter) at ``state``, which a step in motion has reached."""
        self._require_rigid_joints()
        derivatives, trail = self.derivatives, self._trail
        if trail is None or trail.state.positions is not state.positions:
            trail = self._last_step_followed(state, parameters, interrupted)
        return derivatives.along(trail, outputs, parameters)

    def _derivatives_now(
        self, state: State, outputs: Sequence[str], parameters: Sequence[str], interrupted: Interruption
    ) -> Sensitivities:
        trail = self._last_step_followed(state, parameters, interrupted)
        return self.derivatives.along(trail, outputs, parameters)

    def _last_step_followed(self, state: State, parameters: Names, interrupted: Interruption) -> Trail:
        """Repeat the last step, which led to ``state``, and return the trail with its derivatives."""
        last = self._last
        if last is None or last.found.positions is not state.positions:
            raise GdfeError("no derivative: no step in motion led here; remedy: step first")
        trail = self.derivatives.trail(last.start, parameters)
        trail.begin(last.start)
        deadline = Deadline(interrupted=interrupted) if interrupted else None
        given = {"duration": last.duration, "deadline": deadline, "observer": trail.observe}
        self._stepper.step(last.start, last.targets, last.commands, **given)
        if deadline is not None and deadline.has_passed():
            raise GdfeError(ENDED)
        if not np.array_equal(trail.state.positions, state.positions):
            raise GdfeError("no derivative: the last step was cut by a deadline; remedy: step without one")
        return trail
