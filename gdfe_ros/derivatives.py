# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of a scene's outputs with respect to its parameters, by their names."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gdfe_ros.errors import CommandError
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.equilibrium.energy import EnergyEquilibrium
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.sensitivity.columns import EquilibriumColumns
from gdfe_ros.solver.sensitivity.parameter import Parameters
from gdfe_ros.solver.sensitivity.result import Outputs, Sensitivities
from gdfe_ros.solver.sensitivity.variant import Model
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.stepper import Stepper


class Derivatives:
    """Derivatives of a scene.

    Args:
        scene: its outputs and parameters.
        stepper: of its body.

    Attributes:
        parameters: what derivatives can be with respect to.

    Raises:
        CommandError: the policy has no forces.
    """

    def __init__(self, scene: Scene, stepper: Stepper | MotionStepper) -> None:
        if not isinstance(stepper.equilibrium, EnergyEquilibrium):
            raise CommandError("sensitivities need forces, which this policy lacks; remedy: solver.policy: energy")
        names = [handle.name for handle in scene.handles]
        self._outputs = Outputs(scene.probes, names, scene.mesh.n_vertices)
        model = Model(
            materials=scene.materials,
            loads=scene.loads,
            masses=scene.masses,
            filling=scene.mesh.filling,
            dynamics=scene.dynamics,
        )
        self.parameters = Parameters(stepper.body, model, scene.actuators, scene.loads, scene.handles)
        self._usual = tuple(f"actuators.{actuator.name}" for actuator in scene.actuators)
        self._columns = EquilibriumColumns(stepper.equilibrium, model)

    def found(
        self,
        state: State,
        outputs: Sequence[str] | None,
        parameters: Sequence[str] | None,
        *,
        interrupted: Callable[[], bool] | None = None,
    ) -> Sensitivities:
        """Return d(output)/d(parameter) at a state; arguments as of `Simulation.sensitivities`."""
        names, chosen = self._outputs.named(outputs), self.parameters.named(parameters or self._usual)
        return self._columns.found(state, self._outputs, names, chosen, interrupted=interrupted)
