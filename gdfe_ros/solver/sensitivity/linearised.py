# SPDX-License-Identifier: Apache-2.0
"""A converged solve, linearised: K dx + G dm = -dF, with the multipliers m as further unknowns.

Where a solve has converged, the forces F(x, m) vanish and an update changes no multiplier, m = U(x, m). Derivatives of
both vanish too. Products of the elements' tangents are exact; those of all other terms, and of their updates, are
central differences of the very kernels that the solve called. What the pressures and hourglass scales of elements do
is eliminated element by element.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import ENDED, GdfeError
from gdfe_ros.materials.table import MaterialTable
from gdfe_ros.solver.descent.workspace import Problem
from gdfe_ros.solver.elements.operators import Operators
from gdfe_ros.solver.elements.pressures import with_bulk
from gdfe_ros.solver.elements.response import evaluate
from gdfe_ros.solver.equilibrium.energy import EnergyEquilibrium
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.matrix.unknowns import Frame, gather_rigid_rows, place
from gdfe_ros.solver.reactions import vertex_forces
from gdfe_ros.solver.sensitivity.krylov import solved
from gdfe_ros.solver.sensitivity.products import add_products
from gdfe_ros.solver.sensitivity.softening import slopes
from gdfe_ros.solver.sensitivity.volumes import Volumes
from gdfe_ros.solver.state import State
from gdfe_ros.solver.tangent.level import TangentLevel
from gdfe_ros.solver.terms.term import Term, terms_energy

SOFT, STIFF = 1e-6, 1e-8
"""Error of a derivative, and where multipliers keep something: forces there are stiff in it."""
SPACING, NEARER, TURN = 1e-6, 1e-8, 1e-6
"""Displacement of a difference of terms, of one within the way that counts as slipping, and of one that turns handles,
over the body's size."""


class Change(NamedTuple):
    """A derivative of positions and multipliers.

    Attributes:
        unknowns: (3 r,) of the unknowns.
        positions: (n, 3) [m] of all vertices.
        multipliers: (k,) of all terms, one after another.
    """

    unknowns: NDArray[np.float64]
    positions: NDArray[np.float64]
    multipliers: NDArray[np.float64]


class Linearised:
    """A solve at its end.

    Args:
        equilibrium: that solved.
        level: takes tangents of the body; one of its own, which no descent uses.
        start: the state that the solve began with; that at its end where only what comes next is asked for.
        end: the state that it found.

    Attributes:
        x: (n, 3) [m] positions.
        u: (3 r,) unknowns.
        frame: where handles are commanded.
        forces: (n, 3) [N] dE/dx of all terms.
        multipliers: (k,) of all terms, one after another.
        scale: (m,) hourglass scales.
        softening: elements whose scales follow the strain.
        spacing: [m] of differences.
        interrupted: asked at every product; once it tells so, what is going on is an error.
        numbers: (k,) of all terms, as they were at the end.
        volumes: the laws of the elements' volumes there.
    """

    def __init__(self, equilibrium: EnergyEquilibrium, level: TangentLevel, start: State, end: State) -> None:
        self._level, self.end, self.handles = level, end, equilibrium.handles
        self.interrupted: Callable[[], bool] | None = None
        self.body, self.actuation = equilibrium.body, equilibrium.actuation
        solve = Solve.at(equilibrium.model, end)
        task = equilibrium.evaluated(solve)
        self._watch, self._unknowns = task.problem.watch, self.body.unknowns
        work = equilibrium.whole.workspace
        self.x, self.u, self.frame = work.x.copy(), work.u.copy(), task.problem.frame
        for term in self.actuation.terms:
            term.aim(end.poses, start)
            term.resume(end.commands, start.terms[term.name], end.terms[term.name], self.x)
        self._sizes = [len(term.multipliers) for term in self.actuation.terms]
        self.multipliers = self.held()
        self._weights = self._joined(lambda term: term.per_metre)
        self.numbers = self.actuation.table.reals.copy()
        delicate = any(term.delicate for term in self.actuation.terms)
        self.spacing = (NEARER if delicate else SPACING) * self.body.size
        self.table = with_bulk(self.body.table, end.elements.bulk)
        given = end.operators.shape, self.body.material, self.table, end.elements.pressures
        self.volumes, self.scale = Volumes(self.x, *given), end.elements.hourglass_scale
        problem = self._problem()
        tangent = level.take(problem, self.u, self.x)
        if tangent.shift > 0.0:
            raise GdfeError(
                "no derivative: the state is no minimum of the energy, as at a saddle or beyond a buckling load; "
                "remedy: push the body aside first, or step back"
            )
        self._motion, self._stiffness = tangent.motion, level.stiffness
        self._soften(equilibrium)
        self.forces = self.element_forces(self.table) + self.term_forces(self.x)
        self._turning = self._turned_stiffness()

    def term_forces(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return dE/dx (n, 3) [N] of all terms beside the elements."""
        force = np.zeros_like(x)
        if len(self.actuation.table.address):
            terms_energy(x, self.actuation.table, force, np.zeros(1))
        return force

    def element_forces(
        self, table: MaterialTable, *, operators: Operators | None = None, scale: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Return dE/dx (n, 3) [N] of elements with the materials of a ``table``, at the pressures that it asks for."""
        body, found = self.body, operators or self.end.operators
        force, energies = np.zeros((len(body.material), 8, 3)), np.zeros(len(body.material))
        if found is self.end.operators:
            material, pressure = body.material, self.volumes.pressed(body.material, self.table, table)
        else:  # volumes differ
            material, pressure, table = self.volumes.material, self.volumes.pressure, self.volumes.table
        scale = self.scale if scale is None else scale
        given = self.x, found.shape, found.blocks, material, pressure, scale, table, self._watch.watched
        evaluate(*given, force, energies, None)
        return self._summed(force)

    def held(self) -> NDArray[np.float64]:
        """Return the multipliers (k,) in force."""
        return self._joined(lambda term: term.multipliers)

    def hold(self, multipliers: NDArray[np.float64]) -> None:
        """Have all terms take multipliers (k,)."""
        for term, part in zip(self.actuation.terms, self._parts(multipliers), strict=True):
            term.hold(part)

    def updated(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the multipliers (k,) after an update at positions (n, 3) [m]."""
        return self._joined(lambda term: term.updated(x))

    def metres(self, multipliers: NDArray[np.float64]) -> float:
        """Return what a change (k,) of the multipliers is as a displacement [m], at most."""
        return float(np.abs(multipliers / self._weights).max(initial=0.0))

    def restore(self) -> None:
        """Have all terms be as they were at the end."""
        self.actuation.table.reals[...] = self.numbers

    def moved(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the motion (n, 3) [m] of all vertices that one (3 r,) of the unknowns is."""
        motion, count = np.zeros_like(self.x), len(self._unknowns.free)
        motion[self._unknowns.free] = unknowns[: 3 * count].reshape(-1, 3)
        if self._motion.size:
            motion[self._unknowns.members] = (self._motion @ unknowns[3 * count :]).reshape(-1, 3)
        return motion

    def gathered(self, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return forces (n, 3) [N] as those (3 r,) on the unknowns."""
        own = forces[self._unknowns.free].ravel()
        if not self._motion.size:
            return own
        return np.concatenate([own, self._motion.T @ forces[self._unknowns.members].ravel()])

    def product(
        self, motion: NDArray[np.float64], multipliers: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return dF (n, 3) [N] and dU (k,) of a motion (n, 3) [m] and of multipliers (k,)."""
        forces, change = self._beside(motion, multipliers)
        add_products(self._stiffness, self._softened, self._slopes, self.body.cells, motion, forces)
        return forces, change

    def solve(self, forces: NDArray[np.float64], change: NDArray[np.float64], turned: NDArray[np.float64]) -> Change:
        """Return the derivative that balances forces (n, 3) [N] and a change (k,) of what updates find.

        ``turned`` (3 q,) is what else acts on the rigid rows.

        Raises:
            GdfeError: there is none.
        """
        rows = 3 * self._unknowns.rows
        load = self.gathered(forces)
        load[rows - len(turned) :] += turned
        right = np.concatenate([-load, change / self._weights])
        tolerance = STIFF if len(self.multipliers) else SOFT
        found = solved(self._multiplied, self._preconditioned, right, tolerance=tolerance)
        unknowns, multipliers = found[:rows], found[rows:] * self._weights
        return Change(unknowns, self.moved(unknowns), multipliers)

    def rigid_part(self, u: NDArray[np.float64], frame: Frame) -> NDArray[np.float64]:
        """Return what the forces at the end are on the rigid rows (3 q,) where these, or handles, are elsewhere."""
        x, gradient = self.x.copy(), np.zeros_like(u)
        place(u, frame, self._unknowns, x)
        none = np.zeros((len(self.body.material), 8, 3))
        gather_rigid_rows(u, x, none, self.forces, True, frame, self._unknowns, gradient)
        return gradient[3 * len(self._unknowns.free) :]

    def _problem(self) -> Problem:
        end, volumes = self.end, self.volumes
        return Problem(
            end.operators.shape,
            end.operators.blocks,
            volumes.material,
            volumes.pressure,
            self.scale,
            volumes.table,
            self._watch,
            self._unknowns,
            self.frame,
            self.actuation.table,
            None,
        )

    def _soften(self, equilibrium: EnergyEquilibrium) -> None:
        """Take how the forces of elements follow their hourglass scales, where these follow strains."""
        self.softening = equilibrium.whole.softening if equilibrium.model.softening else np.zeros(0, np.int32)
        self._slopes = self._softened = np.zeros((0, 24))
        if not len(self.softening):
            return
        body, shape = self.body, self.end.operators.shape
        self._slopes = slopes(self.x, self.softening, shape, body.material, body.table)
        forces = []
        for side in (0.5, -0.5):  # the force is linear in the scale
            force, energies = np.zeros((len(body.material), 8, 3)), np.zeros(len(body.material))
            given = self.x, shape, self.end.operators.blocks, self.volumes.material, self.volumes.pressure
            none = np.zeros(0, np.int32)
            evaluate(*given, self.scale + side, self.volumes.table, none, force, energies, None)
            forces.append(force.reshape(-1, 24))
        self._softened = forces[0] - forces[1]

    def _turned_stiffness(self) -> NDArray[np.float64]:
        """Return d(force on the rigid rows)/d(rigid rows) (3 q, 3 q) that turning forces about is."""
        first, count = 3 * len(self._unknowns.free), 3 * self._unknowns.rigid_rows
        stiffness, step = np.zeros((count, count)), TURN * self.body.size
        for column in range(count if self._motion.size else 0):
            sides = []
            for sign in (step, -step):
                u = self.u.copy()
                u[first + column] += sign
                sides.append(self.rigid_part(u, self.frame))
            stiffness[:, column] = (sides[0] - sides[1]) / (2.0 * step)
        return stiffness

    def _multiplied(self, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        if self.interrupted is not None and self.interrupted():
            raise GdfeError(ENDED)
        rows = 3 * self._unknowns.rows
        unknowns, multipliers = vector[:rows], vector[rows:] * self._weights
        forces, change = self.product(self.moved(unknowns), multipliers)
        gradient = self.gathered(forces)
        if self._motion.size:
            gradient[3 * len(self._unknowns.free) :] += self._turning @ unknowns[3 * len(self._unknowns.free) :]
        return np.concatenate([gradient, (multipliers - change) / self._weights])

    def _preconditioned(self, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = 3 * self._unknowns.rows
        gradient, multipliers = vector[:rows], vector[rows:]
        if len(multipliers):
            forces, _ = self._beside(np.zeros_like(self.x), multipliers * self._weights)
            gradient = gradient - self.gathered(forces)
        found = np.zeros(rows)
        self._level.solve(np.ascontiguousarray(gradient), found)
        return np.concatenate([found, multipliers])

    def _beside(
        self, motion: NDArray[np.float64], multipliers: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what `product` does, without the elements."""
        largest = max(np.abs(motion).max(initial=0.0), self.metres(multipliers))
        if largest == 0.0 or not len(self.actuation.table.address):
            return np.zeros_like(motion), np.zeros_like(multipliers)
        step, sides = self.spacing / largest, []
        for sign in (step, -step):
            x = self.x + sign * motion
            self.hold(self.multipliers + sign * multipliers)
            sides.append((self.term_forces(x), self.updated(x)))
        self.hold(self.multipliers)
        (first, found), (second, lost) = sides
        return (first - second) / (2.0 * step), (found - lost) / (2.0 * step)

    def _summed(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        return vertex_forces(self.body, np.arange(len(self.x), dtype=np.int32), force)

    def _joined(self, take: Callable[[Term], NDArray[np.float64]]) -> NDArray[np.float64]:
        return np.concatenate([np.zeros(0), *(take(term) for term in self.actuation.terms)])

    def _parts(self, multipliers: NDArray[np.float64]) -> Sequence[NDArray[np.float64]]:
        return np.split(multipliers, np.cumsum(self._sizes)[:-1]) if self._sizes else []
