# SPDX-License-Identifier: Apache-2.0
"""Inputs of solves with a varied parameter, and the derivatives of the linearised solve that result from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.materials.table import MaterialTable
from gdfe_ros.solver.elements.measures import update_hourglass_scales
from gdfe_ros.solver.forces.reactions import handle_reactions
from gdfe_ros.solver.matrix.unknowns import HandlePositions, place
from gdfe_ros.solver.minimise.curvature import TangentProducts
from gdfe_ros.solver.sensitivity.linearised import Linearised, difference, mapped
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import Term

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
    """

    start: State
    commands: Mapping[str, float]
    poses: Mapping[str, Pose]
    table: MaterialTable
    terms: Mapping[str, Term] = field(default_factory=dict)


class Pair(NamedTuple):
    """Inputs of two varied solves, for a central difference about the linearised solve.

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
        """Return the derivative of what ``value`` returns, an array or a mapping or tuple of arrays."""
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
            driven += pair.difference(lambda side: self._placed(side)[0])
            if len(turned):
                turned += pair.difference(lambda side: solve.rigid_part(solve.u, self._placed(side)[1]))
        if driven.any():
            answer, followed = solve.product(driven, np.zeros_like(solve.multipliers))
            forces, change = forces + answer, change + followed
        self._forces, found = forces, solve.solve(forces, change, turned)
        self.change = found._replace(positions=found.positions + driven)

    def reactions(self) -> dict[str, NDArray[np.float64]]:
        """Return a dict from handle or obstacle name to the derivative (6,) of its reaction on the body."""
        solve, change = self._solve, self.change
        forces = self._forces + solve.product(solve.moved(change.unknowns), change.multipliers)[0]
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

    def after(self, made: Callable[[VariedInputs, NDArray[np.float64]], T]) -> T:
        """Return the derivative of ``made(side, positions)``, a mapping of arrays, at the end of the solve.

        Before each call, the terms are set to the inputs ``side``. A derivative that is NaN counts as zero.
        """
        solve, change, own = self._solve, self.change, self._pairs[0].middle

        def value(side: VariedInputs, step: float = 0.0) -> T:
            x = solve.x + step * change.positions
            self._varied(side, x)
            solve.joint.hold(solve.multipliers + step * change.multipliers)
            return made(side, x)

        largest = max(solve.reach(change.positions, change.multipliers), 1e-300)
        step = TangentProducts.SPACING * solve.body.size / largest
        parts = [pair.difference(value) for pair in self._pairs]
        parts.append(difference(value(own, step), value(own, -step), 2.0 * step))
        solve.restore()
        return mapped(lambda *each: np.nan_to_num(sum(each)), *parts)

    def _placed(self, side: VariedInputs) -> tuple[NDArray[np.float64], HandlePositions]:
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

    def _varied(self, side: VariedInputs, x: NDArray[np.float64]) -> None:
        """Set all terms to the inputs ``side``, with the multipliers at the end of the solve."""
        solve = self._solve
        for term in solve.actuation.terms:
            own = side.terms.get(term.name, term)
            own.aim(side.poses, side.start)
            own.vary(side.commands, side.start.terms[term.name], x)
            if own is not term:
                term.reals[...] = own.reals
        solve.joint.hold(solve.multipliers)

    def _terms_part(self, pair: Pair) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the derivatives of the terms' forces (n, 3) and updated multipliers (k,) at constant positions."""
        solve, first, own = self._solve, pair.above, pair.middle
        if not first.terms and (first.commands, first.poses, first.start) == (own.commands, own.poses, own.start):
            return np.zeros_like(solve.x), np.zeros_like(solve.multipliers)

        def numbers(side: VariedInputs) -> NDArray[np.float64]:
            solve.restore()
            self._varied(side, self._placed(side)[0])
            return solve.actuation.table.reals.copy()

        slope, found = pair.difference(numbers), []
        self._numbers += slope
        for sign in (pair.step, -pair.step):
            solve.actuation.table.reals[...] = solve.numbers + sign * slope
            found.append((solve.term_forces(solve.x), solve.joint.updated(solve.x)))
        solve.restore()
        return difference(*found, 2.0 * pair.step)

    def _elements_part(self, pair: Pair) -> NDArray[np.float64]:
        """Return the derivative of the elements' forces (n, 3) at constant positions."""
        solve, growths, before = self._solve, self._solve.actuation.growths, self._solve.end.operators
        same = all(growths.at(side.commands, before) is before for side in (pair.above, pair.below))
        if same and pair.above.table is pair.below.table:
            return np.zeros_like(solve.x)

        def forces(side: VariedInputs) -> NDArray[np.float64]:
            operators, scale = growths.at(side.commands, before), solve.scale.copy()
            if len(solve.softening):
                given = solve.softening, operators.shape, solve.body.material, side.table
                update_hourglass_scales(solve.x, *given, scale)
            return solve.element_forces(side.table, operators=operators, scale=scale)

        return pair.difference(forces)
