# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of a scene's outputs with respect to its parameters, both chosen by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.sensitivity.columns import Outputs, Sensitivities, Tangents, joined
from gdfe_ros.solver.sensitivity.motion import Trail
from gdfe_ros.solver.sensitivity.parameter import MaterialVariant, Parameter, Parameters
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.stepper import Stepper


class Derivatives:
    """Derivatives of a scene's outputs with respect to its parameters.

    Args:
        scene: scene with the outputs and parameters.
        stepper: stepper of the scene's body.

    Attributes:
        parameters: available parameters.

    Raises:
        CommandError: the policy has no forces.
    """

    def __init__(self, scene: Scene, stepper: Stepper | MotionStepper) -> None:
        if not isinstance(stepper.equilibrium, EquilibriumSolver):
            raise CommandError("sensitivities need forces, which this policy lacks; remedy: solver.policy: energy")
        names = [handle.name for handle in scene.handles]
        self._outputs = Outputs(scene.probes, names, scene.mesh.n_vertices)
        model = MaterialVariant(
            materials=scene.materials,
            loads=scene.loads,
            masses=scene.masses,
            filling=scene.mesh.filling,
            dynamics=scene.dynamics,
        )
        self.parameters = Parameters(stepper.body, model, scene.actuators, scene.loads, scene.handles)
        self._usual = tuple(f"actuators.{actuator.name}" for actuator in scene.actuators)
        self._stepper = stepper
        self._tangents: dict[int, Tangents] = {}
        self._own = Tangents(stepper.equilibrium)

    def found(
        self,
        state: State,
        outputs: Sequence[str] | None,
        parameters: Sequence[str] | None,
        *,
        interrupted: Callable[[], bool] | None = None,
    ) -> Sensitivities:
        """Return d(output)/d(parameter) at an equilibrium. The arguments are those of `Simulation.sensitivities`."""
        names, chosen = self._outputs.named(outputs), self.named(parameters)
        return self._own.found(state, self._outputs, names, chosen, interrupted=interrupted)

    def named(self, parameters: Sequence[str] | None) -> list[Parameter]:
        """Return the parameters with these names; None: those of all actuators."""
        return self.parameters.named(self._usual if parameters is None else parameters)

    def trail(self, state: State, parameters: Sequence[str] | None) -> Trail:
        """Return a `Trail`, which updates derivatives along a motion that starts at ``state``."""
        return Trail(self._stepper, self.named(parameters), state, self._tangents)

    def along(self, trail: Trail, outputs: Sequence[str] | None, parameters: Sequence[str] | None) -> Sensitivities:
        """Return d(output)/d(parameter) at the end of a motion, from the ``trail`` that observed it.

        Raises:
            CommandError: the trail does not contain a parameter.
            GdfeError: a step had no derivative.
        """
        if trail.flaw:
            raise GdfeError(trail.flaw)
        names = self._outputs.named(outputs)
        known = {each.name: column for each, column in zip(trail.parameters, trail.columns, strict=True)}
        chosen = list(trail.parameters) if parameters is None else self.named(parameters)
        for each in chosen:
            if each.name not in known:
                raise CommandError(f"{each.name!r} is not followed; followed: {', '.join(known) or 'nothing'}")
        columns = []
        for column in (known[each.name] for each in chosen):
            columns.append({name: self._outputs.row(name, column.positions, column.reactions) for name in names})
        return joined(names, chosen, columns)
