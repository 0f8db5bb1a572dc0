# SPDX-License-Identifier: Apache-2.0
"""Derivatives at an equilibrium, one column per parameter."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.blas import one_blas_thread
from gdfe_ros.errors import GdfeError
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.minimise.level import TangentLevel
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.sensitivity.linearised import Linearised
from gdfe_ros.solver.sensitivity.parameter import Parameter
from gdfe_ros.solver.sensitivity.side import Column, Pair, VariedInputs
from gdfe_ros.solver.state import State


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
        parameters: Sequence[Parameter],
        *,
        reacting: bool,
        interrupted: Callable[[], bool] | None = None,
    ) -> list[tuple[NDArray[np.float64], Mapping[str, NDArray[np.float64]]]]:
        """Return the derivatives at an equilibrium, for each parameter: of positions (n, 3), and of reactions.

        ``reacting`` is whether those of reactions are wanted: dict from handle or obstacle name to derivative (6,).

        Raises:
            GdfeError: the state is no equilibrium, has no derivative, or the computation was interrupted.
        """
        with one_blas_thread():
            solve, columns = self.at(state, state), []
            solve.interrupted = interrupted
            try:
                for parameter in parameters:
                    column = Column(solve, [pair_of(parameter, own_side(solve.body, state))])
                    columns.append((column.change.positions, column.reactions() if reacting else {}))
            finally:
                solve.restore()
        return columns


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
