# SPDX-License-Identifier: Apache-2.0
"""A solve beside the one that is linearised: what differs in what it was given, and what follows in what it found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.materials.table import MaterialTable
from gdfe_ros.solver.elements.measures import update_hourglass_scales
from gdfe_ros.solver.matrix.unknowns import Frame, place
from gdfe_ros.solver.reactions import handle_reactions
from gdfe_ros.solver.sensitivity.linearised import Linearised
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import Saved, Term


@dataclass(frozen=True, eq=False, kw_only=True)
class Side:
    """What a solve beside was given.

    Attributes:
        start: the state that it began with.
        commands: of actuators and loads.
        poses: of handles.
        table: its materials.
        terms: that take the place of those of the same name.
    """

    start: State
    commands: Mapping[str, float]
    poses: Mapping[str, Pose]
    table: MaterialTable
    terms: Mapping[str, Term] = field(default_factory=dict)


class Pair(NamedTuple):
    """Two solves beside the one that is linearised.

    Attributes:
        above, below: on either side of it.
        step: half of by how much they differ, in the unit of what differs.
    """

    above: Side
    below: Side
    step: float


class Column:
    """The derivative of a solve with respect to what a pair of solves differs in.

    Args:
        solve: that is linearised.
        pair: on either side of it.

    Attributes:
        change: of positions, multipliers and forces.

    Raises:
        GdfeError: there is no derivative.
    """

    def __init__(self, solve: Linearised, pair: Pair) -> None:
        self._solve, self._pair = solve, pair
        body, twice = solve.body, 2.0 * pair.step
        sides = [self._placed(side) for side in (pair.above, pair.below)]
        self._driven = (sides[0][0] - sides[1][0]) / twice
        forces, change = self._terms_part([x for x, _ in sides])
        forces = forces + self._elements_part()
        if self._driven.any():
            answer, followed = solve.product(self._driven, np.zeros_like(solve.multipliers))
            forces, change = forces + answer, change + followed
        turned = np.zeros(3 * body.unknowns.rigid_rows)
        if len(turned) and sides[0][1] is not sides[1][1]:
            turned = (solve.rigid_part(solve.u, sides[0][1]) - solve.rigid_part(solve.u, sides[1][1])) / twice
        found = solve.solve(forces, change, turned)
        self.change = found._replace(positions=found.positions + self._driven)

    def reactions(self) -> dict[str, NDArray[np.float64]]:
        """Return the derivative (6,) of what each handle and obstacle exerts on the body."""
        solve, body, step = self._solve, self._solve.body, self._pair.step
        found = []
        for sign, side in ((step, self._pair.above), (-step, self._pair.below)):
            x = self._go(sign, side)
            outside = solve.forces + sign * self.change.forces
            none = np.zeros((len(body.material), 8, 3))
            found.append(handle_reactions(body, x, none, outside, solve.actuation.contacts))
        solve.restore()
        return {name: (value - found[1][name]) / (2.0 * step) for name, value in found[0].items()}

    def saved(self) -> tuple[dict[str, Saved], dict[str, Saved]]:
        """Return what terms keep at the end of either solve beside, whose distance from it is the pair's step."""
        found = []
        for sign, side in ((self._pair.step, self._pair.above), (-self._pair.step, self._pair.below)):
            x, terms = self._go(sign, side), {}
            for term in self._solve.actuation.terms:
                terms[term.name] = side.terms.get(term.name, term).finish(side.start.terms[term.name], x)
            found.append(terms)
        self._solve.restore()
        return found[0], found[1]

    def _placed(self, side: Side) -> tuple[NDArray[np.float64], Frame]:
        """Return positions (n, 3) [m] and the frame with the handles where a side has them."""
        solve, end, handles = self._solve, self._solve.end, self._solve.handles
        base = handles.base(side.poses, end.poses, end.base)
        if base is end.base:
            return solve.x, solve.frame
        x, frame = solve.x.copy(), handles.frame(base)
        prescribed = solve.body.unknowns.prescribed
        x[prescribed] = base[prescribed]
        place(solve.u, frame, solve.body.unknowns, x)
        return x, frame

    def _varied(self, side: Side, x: NDArray[np.float64]) -> None:
        """Have all terms take what a side was given, with the multipliers of the end."""
        solve = self._solve
        for term in solve.actuation.terms:
            own = side.terms.get(term.name, term)
            own.aim(side.poses, side.start)
            own.vary(side.commands, side.start.terms[term.name], x)
            if own is not term:
                term.reals[...] = own.reals
        solve.hold(solve.multipliers)

    def _go(self, sign: float, side: Side) -> NDArray[np.float64]:
        """Have all terms be as at the end of a solve beside; return its positions (n, 3) [m]."""
        solve = self._solve
        x = solve.x + sign * self.change.positions
        self._varied(side, x)
        solve.hold(solve.multipliers + sign * self.change.multipliers)
        return x

    def _terms_part(self, places: list[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return by how much terms pull (n, 3) [N], and updates find (k,), otherwise where vertices are the same."""
        solve, numbers = self._solve, []
        for side, x in zip((self._pair.above, self._pair.below), places, strict=True):
            solve.restore()
            self._varied(side, x)
            numbers.append(solve.actuation.table.reals.copy())
        half, found = 0.5 * (numbers[0] - numbers[1]), []
        for sign in (1.0, -1.0):
            solve.actuation.table.reals[...] = solve.numbers + sign * half
            found.append((solve.term_forces(solve.x), solve.updated(solve.x)))
        solve.restore()
        (first, above), (second, below) = found
        return (first - second) / (2.0 * self._pair.step), (above - below) / (2.0 * self._pair.step)

    def _elements_part(self) -> NDArray[np.float64]:
        """Return by how much elements pull (n, 3) [N] otherwise where vertices are the same."""
        solve, growths, found = self._solve, self._solve.actuation.growths, []
        before = solve.end.operators
        grown = [growths.at(side.commands, before) for side in (self._pair.above, self._pair.below)]
        same = all(operators is before for operators in grown)
        if same and self._pair.above.table is self._pair.below.table:
            return np.zeros_like(solve.x)
        for side, operators in zip((self._pair.above, self._pair.below), grown, strict=True):
            scale = solve.scale.copy()
            if len(solve.softening):
                given = solve.softening, operators.shape, solve.body.material, side.table
                update_hourglass_scales(solve.x, *given, scale)
            found.append(solve.element_forces(side.table, operators=operators, scale=scale))
        return (found[0] - found[1]) / (2.0 * self._pair.step)

