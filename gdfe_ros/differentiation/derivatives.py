# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of a scene's outputs with respect to its parameters, both chosen by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gdfe_ros.differentiation.named_parameters import Parameters
from gdfe_ros.errors import CommandError, GdfeError, require_named
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.sensitivity.columns import Tangents
from gdfe_ros.solver.sensitivity.motion import Trail
from gdfe_ros.solver.sensitivity.parameter import MaterialVariant, Parameter
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.stepper import Stepper
from gdfe_ros.solver.vectors import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensitivities:
    """Derivatives of outputs with respect to parameters.

    Attributes:
        outputs: names, in the order of the rows.
        parameters: names, in the order of the columns.
        units: units of the parameters; empty for a dimensionless parameter.
        values: dict from output name to its derivatives (k, p) float64, in the output's unit divided by the parameter's
            unit; outputs are positions [m], forces [N] and moments [N m].
    """

    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: Mapping[str, Array]

    @property
    def matrix(self) -> Array:
        """All rows (sum of k, p), output by output.

        Raises:
            CommandError: no parameter was requested, e.g. because the scene has no actuators.
        """
        if not self.parameters:
            raise CommandError("no derivatives: no parameter was named, and the scene may have no actuators")
        rows = [self.values[name] for name in self.outputs]
        return np.concatenate(rows) if rows else np.zeros((0, len(self.parameters)))

    def of(self, output: str, parameter: str) -> Array:
        """Return d(output)/d(parameter) (k,).

        Raises:
            CommandError: the output or the parameter was not requested.
        """
        for name, known in ((output, self.outputs), (parameter, self.parameters)):
            if name not in known:
                raise CommandError(f"{name!r} was not asked for; asked for: {', '.join(known) or 'nothing'}")
        return self.values[output][:, self.parameters.index(parameter)]


class Outputs:
    """The outputs of a scene: ``positions``, ``probes.<name>``, ``reactions.<handle or obstacle>``.

    Args:
        probes: dict from name to material point.
        reacting: names of handles and obstacles.
        count: number of vertices of the mesh.
    """

    def __init__(self, probes: Mapping[str, object], reacting: Sequence[str], count: int) -> None:
        self._probes, self._reacting, self._count = probes, tuple(reacting), count

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all outputs."""
        probes = (f"probes.{name}" for name in self._probes)
        return (*probes, *(f"reactions.{name}" for name in self._reacting), "positions")

    def check_names(self, names: Sequence[str] | None) -> tuple[str, ...]:
        """Return ``names`` after a check; the names of all probes for None.

        Raises:
            CommandError: there is no such output.
        """
        if names is None:
            return tuple(f"probes.{name}" for name in self._probes)
        for name in names:
            require_named("output", name, self.names, " in this scene")
        return tuple(names)

    def row(self, name: str, motion: Array, reactions: Mapping[str, Array]) -> Array:
        """Return the derivative (k,) of an output from the derivatives of positions (n, 3) and reactions (6,)."""
        if name == "positions":
            return motion[: self._count].ravel()
        kind, _, own = name.partition(".")
        return self._probes[own].at(motion)[0] if kind == "probes" else reactions[own]


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

    def derive_outputs(
        self,
        state: State,
        outputs: Sequence[str] | None,
        parameters: Sequence[str] | None,
        *,
        interrupted: Callable[[], bool] | None = None,
    ) -> Sensitivities:
        """Return d(output)/d(parameter) at an equilibrium. The arguments are those of `Simulation.sensitivities`."""
        names, chosen = self._outputs.check_names(outputs), self.choose_parameters(parameters)
        reacting = any(name.startswith("reactions.") for name in names)
        columns = self._own.derive_columns(state, chosen, reacting=reacting, interrupted=interrupted)
        return join_columns(self._outputs, names, chosen, columns)

    def choose_parameters(self, parameters: Sequence[str] | None) -> list[Parameter]:
        """Return the parameters with these names; None: the commands of all actuators."""
        return self.parameters.find_parameters(self._usual if parameters is None else parameters)

    def trail(self, state: State, parameters: Sequence[str] | None) -> Trail:
        """Return a `Trail`, which updates derivatives along a motion that starts at ``state``."""
        return Trail(self._stepper, self.choose_parameters(parameters), state, self._tangents)

    def along(self, trail: Trail, outputs: Sequence[str] | None, parameters: Sequence[str] | None) -> Sensitivities:
        """Return d(output)/d(parameter) at the end of a motion, from the ``trail`` that observed it.

        Raises:
            CommandError: the trail does not contain a parameter.
            GdfeError: a step had no derivative.
        """
        if trail.flaw:
            raise GdfeError(trail.flaw)
        names = self._outputs.check_names(outputs)
        known = {each.name: column for each, column in zip(trail.parameters, trail.columns, strict=True)}
        chosen = list(trail.parameters) if parameters is None else self.choose_parameters(parameters)
        for each in chosen:
            if each.name not in known:
                raise CommandError(f"{each.name!r} is not followed; followed: {', '.join(known) or 'nothing'}")
        followed = (known[each.name] for each in chosen)
        columns = [(column.positions, column.reactions) for column in followed]
        return join_columns(self._outputs, names, chosen, columns)


def join_columns(
    outputs: Outputs,
    names: Sequence[str],
    parameters: Sequence[Parameter],
    columns: Sequence[tuple[Array, Mapping[str, Array]]],
) -> Sensitivities:
    """Return the columns of all parameters as one result; a column has derivatives of positions and of reactions."""
    rows = {name: [outputs.row(name, *column) for column in columns] for name in names} if columns else {}
    return Sensitivities(
        outputs=tuple(names),
        parameters=tuple(each.name for each in parameters),
        units=tuple(each.unit for each in parameters),
        values={name: np.stack(found, axis=1) for name, found in rows.items()},
    )
