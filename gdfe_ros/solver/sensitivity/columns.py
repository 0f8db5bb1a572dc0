# SPDX-License-Identifier: Apache-2.0
"""Derivatives of solves, one column per parameter, from linearised solves and varied inputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeVar

import numpy as np

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import GdfeError
from gdfe_ros.materials.table import MaterialTable
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.measures import update_hourglass_scales
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.forces.actuation import handle_reactions
from gdfe_ros.solver.matrix.unknowns import HandlePositions, place
from gdfe_ros.solver.minimise.curvature import TangentProducts
from gdfe_ros.solver.minimise.level import TangentLevel
from gdfe_ros.solver.motion.inertia import FreeMass
from gdfe_ros.solver.sensitivity.linearised import Linearised, difference, map_arrays
from gdfe_ros.solver.sensitivity.parameter import Parameter
from gdfe_ros.solver.settings import Dynamics
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import Term
from gdfe_ros.solver.vectors import Array
from gdfe_ros.threads import one_blas_thread

T = TypeVar("T")


@dataclass(frozen=True, eq=False, kw_only=True)
class VariedInputs:
    """Inputs of a varied solve.

    Attributes:
        start: state at the beginning.
        commands: dict from actuator or load name to command.
        poses: dict from handle name to commanded pose.
        table: packed materials.
        terms: dict from term name to a term that replaces the term of this name.
        free_mass: mass of the free vertices and the rigid bodies in motion; None if it is that of the linearised solve.
    """

    start: State
    commands: Mapping[str, float]
    poses: Mapping[str, Pose]
    table: MaterialTable
    terms: Mapping[str, Term] = field(default_factory=dict)
    free_mass: FreeMass | None = None


class Pair(NamedTuple):
    """Inputs of two varied solves on both sides of the linearised solve, for a central difference.

    Attributes:
        above, below: inputs with a quantity increased and decreased.
        middle: inputs of the linearised solve.
        step: half of the difference of the quantity between ``above`` and ``below``, in the unit of the quantity.
    """

    above: VariedInputs
    below: VariedInputs
    middle: VariedInputs
    step: float

    def difference(self, value: Callable[[VariedInputs], T]) -> T:
        """Return the derivative of ``value(side)``, an array or a mapping or tuple of arrays."""
        return difference(value(self.above), value(self.below), 2.0 * self.step)


class Column:
    """Derivative of a solve with respect to one parameter: the sum of the derivatives for several pairs of inputs.

    Args:
        solve: the linearised solve.
        pairs: pairs of varied inputs.

    Attributes:
        change: derivative of positions and multipliers.

    Raises:
        GdfeError: the tangent is singular, so that there is no derivative.
    """

    def __init__(self, solve: Linearised, pairs: Sequence[Pair]) -> None:
        self._solve, self._pairs, body = solve, pairs, solve.body
        self._numbers, forces = np.zeros(len(solve.numbers)), np.zeros_like(solve.x)
        change, driven = np.zeros(len(solve.multipliers)), np.zeros_like(solve.x)
        turned = np.zeros(3 * body.unknowns.rigid_rows)
        for pair in pairs:
            pulled, updated = self._terms_part(pair)
            forces, change = forces + pulled + self._elements_part(pair), change + updated
            driven += pair.difference(lambda side: self._place_handles(side)[0])
            if len(turned):
                turned += pair.difference(lambda side: solve.rigid_part(solve.u, self._place_handles(side)[1]))
        if driven.any():
            answer, followed = solve.product(driven, np.zeros_like(solve.multipliers))
            forces, change = forces + answer, change + followed
        self._forces, found = forces, solve.solve(forces, change, turned)
        self.change = found._replace(positions=found.positions + driven)

    def reactions(self) -> dict[str, Array]:
        """Return a dict from handle or obstacle name to the derivative (6,) of its reaction on the body."""
        solve, change = self._solve, self.change
        forces = self._forces + solve.product(solve.find_displacements(change.unknowns), change.multipliers)[0]
        step, found = solve.spacing / max(solve.reach(change.positions, change.multipliers), 1e-300), []
        for sign in (step, -step):
            solve.actuation.table.reals[...] = solve.numbers + sign * self._numbers
            solve.joint.hold(solve.multipliers + sign * change.multipliers)
            given = solve.x + sign * change.positions, solve.no_forces()
            solve.turn_contacts(given[0])
            outside = solve.forces + sign * forces
            others = solve.actuation.contacts, solve.actuation.grips
            found.append(handle_reactions(solve.body, *given, outside, *others))
        solve.restore()
        return difference(*found, 2.0 * step)

    def after(self, made: Callable[[VariedInputs, Array], T]) -> T:
        """Return the derivative of the result of ``made``, a mapping of arrays, at the end of the solve.

        ``made`` is called with varied inputs (``side``) and positions (n, 3) [m], after the terms have been set to
        them. A derivative that is NaN counts as zero.
        """
        solve, change, own = self._solve, self.change, self._pairs[0].middle

        def value(side: VariedInputs, step: float = 0.0) -> T:
            x = solve.x + step * change.positions
            self._vary(side, x)
            solve.joint.hold(solve.multipliers + step * change.multipliers)
            return made(side, x)

        largest = max(solve.reach(change.positions, change.multipliers), 1e-300)
        step = TangentProducts.SPACING * solve.body.size / largest
        parts = [pair.difference(value) for pair in self._pairs]
        parts.append(difference(value(own, step), value(own, -step), 2.0 * step))
        solve.restore()
        return map_arrays(lambda *each: np.nan_to_num(sum(each)), *parts)

    def _place_handles(self, side: VariedInputs) -> tuple[Array, HandlePositions]:
        """Return positions (n, 3) [m] and the frame with the handles at the poses of ``side``."""
        solve, end, handles = self._solve, self._solve.end, self._solve.handles
        base = handles.base(side.poses, end.poses, end.base)
        if base is end.base:
            return solve.x, solve.frame
        x, frame = solve.x.copy(), handles.frame(base)
        prescribed = solve.body.unknowns.prescribed
        x[prescribed] = base[prescribed]
        place(solve.u, frame, solve.body.unknowns, x)
        return x, frame

    def _vary(self, side: VariedInputs, x: Array) -> None:
        """Set all terms to the inputs ``side``, with the multipliers at the end of the solve."""
        solve = self._solve
        for term in solve.actuation.terms:
            own = side.terms.get(term.name, term)
            own.set_targets(side.poses, side.start)
            own.vary(side.commands, side.start.terms[term.name], x)
            if own is not term:
                term.reals[...] = own.reals
        solve.joint.hold(solve.multipliers)

    def _terms_part(self, pair: Pair) -> tuple[Array, Array]:
        """Return the derivatives of the terms' forces (n, 3) and updated multipliers (k,) at constant positions."""
        solve, first, own = self._solve, pair.above, pair.middle
        if not first.terms and (first.commands, first.poses, first.start) == (own.commands, own.poses, own.start):
            return np.zeros_like(solve.x), np.zeros_like(solve.multipliers)

        def numbers(side: VariedInputs) -> Array:
            solve.restore()
            self._vary(side, self._place_handles(side)[0])
            return solve.actuation.table.reals.copy()

        slope, found = pair.difference(numbers), []
        self._numbers += slope
        for sign in (pair.step, -pair.step):
            solve.actuation.table.reals[...] = solve.numbers + sign * slope
            found.append((solve.term_forces(solve.x), solve.joint.updated(solve.x)))
        solve.restore()
        return difference(*found, 2.0 * pair.step)

    def _elements_part(self, pair: Pair) -> Array:
        """Return the derivative of the elements' forces (n, 3) at constant positions."""
        solve, growths, before = self._solve, self._solve.actuation.growths, self._solve.end.operators
        same = all(growths.at(side.commands, before) is before for side in (pair.above, pair.below))
        if same and pair.above.table is pair.below.table:
            return np.zeros_like(solve.x)

        def forces(side: VariedInputs) -> Array:
            operators, scale = growths.at(side.commands, before), solve.scale.copy()
            if len(solve.softening):
                given = solve.softening, operators.shape, solve.body.material, side.table
                update_hourglass_scales(solve.x, *given, scale)
            return solve.element_forces(side.table, operators=operators, scale=scale)

        return pair.difference(forces)


class Tangents:
    """Linearises solves of one body; the symbolic factorisation of the tangent is made once.

    The last linearised solve is cached, so that further columns of the same solve need no new factor.

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

    def derive_columns(
        self,
        state: State,
        parameters: Sequence[Parameter],
        *,
        reacting: bool,
        interrupted: Callable[[], bool] | None = None,
    ) -> list[tuple[Array, Mapping[str, Array]]]:
        """Return the derivatives of positions (n, 3) and reactions at an equilibrium, for each parameter.

        The derivatives of reactions are a dict from handle or obstacle name to derivative (6,). It is empty unless
        ``reacting`` is True.

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
    """Return the inputs of two solves, one with the parameter increased and one with the parameter decreased.

    Args:
        parameter: the varied parameter, which also defines the size of the change.
        own: inputs without the change.
        h: length of the internal step [s]; None in statics.
        scheme: settings of the motion; None in statics.
        share: fraction of the change of commands and poses that is reached at the end of the solve. In motion, commands
            and poses change linearly during a step, and the solve is one internal step of this step.
    """
    sides, step = [], parameter.step(own.commands)
    for change in (step, -step):
        variant = parameter.model(parameter.value + change) if parameter.model else None
        sides.append(
            replace(
                own,
                commands=parameter.change_commands(own.commands, share * change),
                poses=parameter.change_poses(own.poses, share * change),
                table=variant.table if variant else own.table,
                terms=variant.terms(h, scheme) if variant else {},
                free_mass=variant.free_mass if variant and h is not None else None,
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
