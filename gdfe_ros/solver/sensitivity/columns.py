# SPDX-License-Identifier: Apache-2.0
"""Derivatives at an equilibrium, one column per parameter, and the result of their computation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.blas import one_blas_thread
from gdfe_ros.errors import CommandError, GdfeError, require_named
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.minimise.level import TangentLevel
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.sensitivity.linearised import Linearised
from gdfe_ros.solver.sensitivity.parameter import Parameter
from gdfe_ros.solver.sensitivity.side import Column, Pair, VariedInputs
from gdfe_ros.solver.state import State


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
    values: Mapping[str, NDArray[np.float64]]

    @property
    def matrix(self) -> NDArray[np.float64]:
        """All rows (sum of k, p), output by output.

        Raises:
            CommandError: no parameter was requested, e.g. because the scene has no actuators.
        """
        if not self.parameters:
            raise CommandError("no derivatives: no parameter was named, and the scene may have no actuators")
        rows = [self.values[name] for name in self.outputs]
        return np.concatenate(rows) if rows else np.zeros((0, len(self.parameters)))

    def of(self, output: str, parameter: str) -> NDArray[np.float64]:
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

    def named(self, names: Sequence[str] | None) -> tuple[str, ...]:
        """Return ``names`` after a check; the names of all probes for None.

        Raises:
            CommandError: there is no such output.
        """
        if names is None:
            return tuple(f"probes.{name}" for name in self._probes)
        for name in names:
            require_named("output", name, self.names, " in this scene")
        return tuple(names)

    def row(
        self, name: str, motion: NDArray[np.float64], reactions: Mapping[str, NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """Return the derivative (k,) of an output from the derivatives of positions (n, 3) and reactions (6,)."""
        if name == "positions":
            return motion[: self._count].ravel()
        kind, _, own = name.partition(".")
        return self._probes[own].at(motion)[0] if kind == "probes" else reactions[own]


class Tangents:
    """Linearises solves of one body, with one symbolic analysis of the factor.

    The last linearised solve is cached, so that further columns of the same state need no new factor.

    Args:
        equilibrium: the equilibrium solver.
    """

    def __init__(self, equilibrium: EquilibriumSolver) -> None:
        self._equilibrium = equilibrium
        self._level: TangentLevel | None = None
        self._last: tuple[State, State, Linearised] | None = None

    def at(self, start: State, end: State) -> Linearised:
        """Return the linearised solve that began at ``start`` and ended at ``end``.

        Raises:
            GdfeError: ``end`` is no equilibrium, or has no derivative.
        """
        if self._last is not None and self._last[0] is start and self._last[1] is end:
            self._last[2].resume()
            return self._last[2]
        require_differentiable(end)
        equilibrium, self._last = self._equilibrium, None
        if self._level is None:
            terms = equilibrium.actuation.terms
            self._level = TangentLevel(equilibrium.body, equilibrium.matrix.assembled, terms)
        made = Linearised(equilibrium, self._level, start, end)
        self._last = start, end, made
        return made

    def found(
        self,
        state: State,
        outputs: Outputs,
        names: Sequence[str],
        parameters: Sequence[Parameter],
        *,
        interrupted: Callable[[], bool] | None = None,
    ) -> Sensitivities:
        """Return d(output)/d(parameter) at an equilibrium, for the named outputs and parameters.

        Raises:
            GdfeError: the state is no equilibrium, has no derivative, or the computation was interrupted.
        """
        with one_blas_thread():
            solve, columns = self.at(state, state), []
            solve.interrupted = interrupted
            try:
                for parameter in parameters:
                    pair = pair_of(parameter, own_side(solve.body, state))
                    columns.append(rows_of(Column(solve, [pair]), outputs, names))
            finally:
                solve.restore()
        return joined(names, parameters, columns)


def own_side(body: Body, state: State, end: State | None = None) -> VariedInputs:
    """Return the unvaried inputs of the solve from ``state`` to ``end``; None stands for ``state`` itself."""
    end = end or state
    return VariedInputs(start=state, commands=end.commands, poses=end.poses, table=body.table)


def pair_of(
    parameter: Parameter,
    own: VariedInputs,
    *,
    h: float | None = None,
    scheme: Dynamics | None = None,
    share: float = 1.0,
) -> Pair:
    """Return the inputs of two solves with a parameter increased and decreased.

    In motion, internal steps have the length ``h`` [s] and use ``scheme``. Commands and poses change linearly during a
    step. At the end of this solve, they have changed by the fraction ``share`` of their variation.
    """
    sides, step = [], parameter.step(own.commands)
    for change in (step, -step):
        variant = parameter.model(parameter.value + change) if parameter.model else None
        sides.append(
            replace(
                own,
                commands=parameter.commanded(own.commands, share * change),
                poses=parameter.posed(own.poses, share * change),
                table=variant.table if variant else own.table,
                terms=variant.terms(h, scheme) if variant else {},
            )
        )
    return Pair(*sides, own, step)


def rows_of(column: Column, outputs: Outputs, names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Return a dict from output name to its derivative (k,), from the column of one parameter."""
    reactions = column.reactions() if any(name.startswith("reactions.") for name in names) else {}
    return {name: outputs.row(name, column.change.positions, reactions) for name in names}


def joined(
    names: Sequence[str], parameters: Sequence[Parameter], columns: Sequence[dict[str, NDArray[np.float64]]]
) -> Sensitivities:
    """Return the columns of all parameters as one result."""
    values = {name: np.stack([column[name] for column in columns], axis=1) for name in names} if columns else {}
    return Sensitivities(
        outputs=tuple(names),
        parameters=tuple(each.name for each in parameters),
        units=tuple(each.unit for each in parameters),
        values=values,
    )


def require_differentiable(state: State) -> None:
    """Raise an error for a state that is no stable equilibrium.

    Raises:
        GdfeError: the state has not converged, is a saddle, or has folded elements.
    """
    summary = state.summary
    if summary.stable is False:
        raise GdfeError(f"no derivative: {summary.message}")
    if not summary.converged or not summary.min_det > 0.0:
        said = summary.message or "it has not been solved yet"
        raise GdfeError(f"no derivative: the state is no equilibrium: {said}; remedy: step until it has converged")
