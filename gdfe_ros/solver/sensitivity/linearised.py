# SPDX-License-Identifier: Apache-2.0
"""Linearisation of a converged solve: K dx + G dm = -dF, with the multipliers m as further unknowns.

At the end of a converged solve, the forces F(x, m) are zero. An update U leaves the multipliers unchanged: m = U(x, m).
The derivatives of the solution satisfy the linearised forms of both equations. Products with the elements' tangents are
exact. Products with the tangents of all other terms, and with the derivatives of U, are central differences of the
kernels that the solve called. The response of the elements' pressures and hourglass scales is eliminated element by
element.

In a solve, a pressure and a soft penalty keep the volume of nearly incompressible elements. At the end, with the volume
ratio J_0, they amount to the pressure p = U'(J_0) of the volume law U. In the linearisation, the kernels receive the
law U itself, plus a small pressure that corrects the remaining error of J_0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.errors import ENDED, GdfeError
from gdfe_ros.materials.material import Law
from gdfe_ros.materials.table import BULK, CARRIED, LAME, PENALTY, SHEAR, MaterialTable
from gdfe_ros.mesh.cells.operators import ShapeOperators
from gdfe_ros.solver.elements.blocks import Operators
from gdfe_ros.solver.elements.cell_type import volume_ratio
from gdfe_ros.solver.elements.measures import update_hourglass_scales
from gdfe_ros.solver.elements.response import evaluate
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.forces.actuation import vertex_forces
from gdfe_ros.solver.forces.pressures import with_bulk
from gdfe_ros.solver.matrix.unknowns import HandlePositions, gather_rigid_rows, generalise, place
from gdfe_ros.solver.minimise.level import TangentLevel
from gdfe_ros.solver.sensitivity.krylov import ConjugateResiduals
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.multiplier import Multipliers
from gdfe_ros.solver.terms.term import terms_energy
from gdfe_ros.solver.vectors import Array

STIFF = 1e4
"""Finite substitute for an infinite bulk modulus, divided by the penalty bulk modulus. The relative error is 1e-5."""


@kernel
def write_volume_ratios(x, shape, ratios):
    """Write the volume ratio of each element to ``ratios`` (m,), at positions ``x`` (n, 3) [m]."""
    for e in range(len(ratios)):
        ratios[e] = volume_ratio(x, shape, e)


def elastic(table: MaterialTable) -> MaterialTable:
    """Return the material table with the materials' own volume laws in place of penalties."""
    parameters = table.parameters.copy()
    carried, bulk = parameters[:, CARRIED] == 1.0, parameters[:, BULK]
    logarithmic = (table.law == Law.NEO_HOOKEAN) & np.isfinite(bulk)
    whole = np.where(np.isinf(bulk), STIFF * parameters[:, PENALTY], bulk)
    parameters[carried, PENALTY] = np.where(logarithmic, 0.0, whole)[carried]
    parameters[carried, LAME] = np.where(logarithmic, bulk - 2.0 / 3.0 * parameters[:, SHEAR], 0.0)[carried]
    return table._replace(parameters=parameters)


class Volumes:
    """The volume laws of elements at a state.

    Args:
        x: (n, 3) [m] positions of the state.
        shape: operators of the elements.
        material: (m,) int32 material index of each element.
        table: the materials, with the present penalty bulk moduli.
        pressure: (m,) [Pa] pressures p_e of the state.

    Attributes:
        table: the materials with their own volume laws.
        rigid: whether any element is incompressible.
    """

    def __init__(
        self, x: Array, shape: ShapeOperators, material: NDArray[np.int32], table: MaterialTable, pressure: Array
    ) -> None:
        self._material, self._ratio, self.table = material, np.empty(len(material)), elastic(table)
        write_volume_ratios(x, shape, self._ratio)
        own = table.parameters[material]
        kept = pressure + own[:, PENALTY] * (self._ratio - 1.0)
        self._total = np.where(own[:, CARRIED] == 1.0, kept, self._slopes(self.table))
        self.rigid = bool(np.isinf(own[:, BULK]).any())

    def pressures(self, table: MaterialTable) -> Array:
        """Return the pressures p_e (m,) [Pa] that elements need with the materials of ``table`` (see `elastic`) at J_0.

        At J_0, the volume law and p_e together give the pressure of the state, times the ratio of the new to the old
        modulus if the bulk modulus is finite.
        """
        old, new = (each.parameters[self._material] for each in (self.table, table))
        carried = new[:, CARRIED] == 1.0
        share = np.ones(len(new))
        moduli = [each[:, LAME] + each[:, PENALTY] for each in (new, old)]
        np.divide(*moduli, out=share, where=carried & np.isfinite(new[:, BULK]))
        return np.where(carried, share * self._total - self._slopes(table), 0.0)

    def _slopes(self, table: MaterialTable) -> Array:
        """Return the slopes U' (m,) [Pa] of the volume laws in an `elastic` table at J_0."""
        parameters, ratio = table.parameters[self._material], self._ratio
        return parameters[:, LAME] * np.log(ratio) / ratio + parameters[:, PENALTY] * (ratio - 1.0)


T = TypeVar("T")


class StateDerivative(NamedTuple):
    """A derivative of positions and multipliers.

    Attributes:
        unknowns: (3 r,) derivative of the unknowns.
        positions: (n, 3) derivative of all vertex positions.
        multipliers: (k,) derivative of the multipliers of all terms, one term after another.
    """

    unknowns: Array
    positions: Array
    multipliers: Array


def map_arrays(function: Callable[..., object], *values: object) -> object:
    """Apply ``function`` to arrays, or to the corresponding arrays of tuples or mappings; return the results alike."""
    first = values[0]
    if isinstance(first, Mapping):
        return {name: map_arrays(function, *(each[name] for each in values)) for name in first}
    if isinstance(first, tuple):
        return tuple(map_arrays(function, *each) for each in zip(*values, strict=True))
    return function(*values)


def difference(above: T, below: T, twice: float) -> T:
    """Return the difference of arrays, or of tuples or mappings of arrays, divided by ``twice``."""

    def subtract(high: Array, low: Array) -> Array:
        return np.subtract(high, low, out=np.zeros_like(high), where=high != low) / twice  # some limits are infinite

    return map_arrays(subtract, above, below)


class Linearised:
    """A converged solve and its linearisation.

    Args:
        equilibrium: the equilibrium solver.
        level: tangent preconditioner of the body; no minimisation may use this instance.
        start: state at the beginning of the solve; may be ``end`` if the beginning does not matter.
        end: state at the end of the solve.

    Attributes:
        x: (n, 3) [m] positions.
        u: (3 r,) unknowns.
        frame: commanded positions of the handles.
        forces: (n, 3) [N] dE/dx of elements and terms.
        joint: the multipliers of all terms as one vector (`Multipliers`).
        multipliers: (k,) the multipliers at the end.
        scale: (m,) hourglass scales.
        softening: indices of the elements whose hourglass scales depend on the strain.
        spacing: displacement [m] of finite differences.
        interrupted: function that is called at every product; when it returns True, the computation ends with an error.
        numbers: the arrays ``reals`` of all terms at the end, joined.
        volumes: volume laws of the elements at the end.
    """

    EXACT, STIFF = 1e-8, 1e-10
    """Relative tolerances of the linear solve, without and with incompressible elements. With incompressible elements,
    small errors of positions cause large errors of reactions.
    """
    SPACING, NEARER, TURN = 1e-6, 1e-8, 1e-6
    """Displacements in finite differences, divided by the body's size: for terms without friction; for terms with
    friction, because slips may be tiny; and for rotations of handles.
    """

    def __init__(self, equilibrium: EquilibriumSolver, level: TangentLevel, start: State, end: State) -> None:
        self._level, self._start, self.end, self.handles = level, start, end, equilibrium.handles
        self.interrupted: Callable[[], bool] | None = None
        self._system: ConjugateResiduals | None = None
        self.body, self.actuation = equilibrium.body, equilibrium.actuation
        solve = Solve.at(equilibrium.model, end)
        task = solve.evaluate()
        self._watch, self._unknowns = task.problem.watch, self.body.unknowns
        work = equilibrium.whole.workspace
        self.x, self.u, self.frame = work.x.copy(), work.u.copy(), task.problem.frame
        self._resume_terms()
        self.joint = Multipliers(self.actuation.terms)
        self.multipliers, self._weights = self.joint.collect_multipliers(), self.joint.per_metre
        self.numbers = self.actuation.table.reals.copy()
        delicate = any(term.delicate for term in self.actuation.terms)
        self.spacing = (self.NEARER if delicate else self.SPACING) * self.body.size
        self.table = with_bulk(self.body.table, end.elements.bulk)
        given = end.operators.shape, self.body.material, self.table, end.elements.pressures
        self.volumes, self.scale = Volumes(self.x, *given), end.elements.hourglass_scale
        tables = {"table": self.volumes.table, "pressure": self.volumes.pressures(self.volumes.table)}
        problem = task.problem._replace(blocks=end.operators.blocks, scale=self.scale, **tables)
        tangent = level.factor_tangent(problem, self.u, self.x)
        pressed = any(end.terms[contact.name]["press"].any() for contact in self.actuation.contacts)
        if tangent.shift > 0.0 and not pressed:  # contact may hold a body that is unstable alone
            raise GdfeError(
                "no derivative: the state is no minimum of the energy, as at a saddle or beyond a buckling load; "
                "remedy: push the body aside first, or step back"
            )
        self._motion, self._stiffness = tangent.motion, level.stiffness
        self._soften(equilibrium)
        self.forces = self.element_forces(self.table) + self.term_forces(self.x)

    def resume(self) -> None:
        """Restore the commands and states of all terms at the end of the solve; other solves may have changed them."""
        self.interrupted, self._system = None, None  # results must not depend on earlier right-hand sides
        self._resume_terms()
        self.restore()

    def _resume_terms(self) -> None:
        start, end = self._start, self.end
        for term in self.actuation.terms:
            term.set_targets(end.poses, start)
            term.resume(end.commands, start.terms[term.name], end.terms[term.name], self.x)

    def term_forces(self, x: Array) -> Array:
        """Return dE/dx (n, 3) [N] of all terms other than the elements."""
        force = np.zeros_like(x)
        self.turn_contacts(x)
        if len(self.actuation.table.address):
            terms_energy(x, self.actuation.table, force, np.zeros(1))
        return force

    def turn_contacts(self, x: Array) -> None:
        """Update the contact forces to positions ``x`` (n, 3) [m], where they turn with the surfaces."""
        for contact in self.actuation.contacts:
            contact.look(x)
        if self.actuation.contacts:
            self.actuation.held.set_loads(x)

    def element_forces(
        self, table: MaterialTable, *, operators: Operators | None = None, scale: Array | None = None
    ) -> Array:
        """Return dE/dx (n, 3) [N] of the elements with the materials of ``table``; pressures follow from `Volumes`."""
        return self._sum(self._corner_forces(elastic(table), operators, self.scale if scale is None else scale))

    def _corner_forces(self, table: MaterialTable, operators: Operators | None, scale: Array) -> Array:
        """Return dE/dx (m, c, 3) [N] of elements with an `elastic` ``table``; operators None: those of the state."""
        force, energies, found = self.no_forces(), np.zeros(len(self.body.material)), operators or self.end.operators
        given = self.body.material, self.volumes.pressures(table), scale, table, self._watch.watched
        evaluate(self.x, found.shape, found.blocks, *given, force, energies, None)
        return force

    def no_forces(self) -> Array:
        """Return zero forces (m, c, 3) [N] of the elements on their nodes."""
        return np.zeros((*self.body.cells.shape, 3))

    def restore(self) -> None:
        """Reset the numbers and multipliers of all terms to their values at the end of the solve."""
        self.actuation.table.reals[...] = self.numbers
        self.joint.hold(self.multipliers)

    def find_displacements(self, unknowns: Array) -> Array:
        """Return the displacements (n, 3) [m] of all vertices for a displacement (3 r,) of the unknowns."""
        motion, count = np.zeros_like(self.x), 3 * len(self._unknowns.free)
        motion[self._unknowns.free] = unknowns[:count].reshape(-1, 3)
        motion[self._unknowns.members] = (self._motion @ unknowns[count:]).reshape(-1, 3)
        return motion

    def gather_forces(self, forces: Array) -> Array:
        """Return forces (n, 3) [N] as generalised forces (3 r,) on the unknowns."""
        return generalise(forces, self._unknowns, self._motion)

    def product(self, motion: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return dF (n, 3) [N] and dU (k,) for a displacement (n, 3) [m] and a change of the multipliers (k,)."""
        forces, change = self._beside(motion, multipliers)
        local = motion[self.body.cells]
        own = (self._stiffness @ local.reshape(len(local), -1, 1)).reshape(local.shape)
        if len(self.softening):
            own += self._softened * self._scale_change(motion)[:, None, None]
        return forces + self._sum(own), change

    def solve(self, forces: Array, change: Array, turned: Array) -> StateDerivative:
        """Return the derivative of the solution from the derivatives of forces F and updates U at constant x and m.

        Args:
            forces: (n, 3) derivative of the forces.
            change: (k,) derivative of the updated multipliers.
            turned: (3 q,) derivative of the generalised forces on the rigid rows (the unknown motions of handles), in
                addition to ``forces``.

        Raises:
            GdfeError: the tangent is singular, so that there is no derivative.
        """
        rows = 3 * self._unknowns.rows
        load = self.gather_forces(forces)
        load[rows - len(turned) :] += turned
        right = np.concatenate([-load, change / self._weights])
        if self._system is None:
            tolerance = self.STIFF if self.volumes.rigid else self.EXACT
            self._system = ConjugateResiduals(self._multiply, self._precondition, tolerance=tolerance)
        found = self._system.solve(right)
        unknowns, multipliers = found[:rows], found[rows:] * self._weights
        return StateDerivative(unknowns, self.find_displacements(unknowns), multipliers)

    def rigid_part(self, u: Array, frame: HandlePositions) -> Array:
        """Return the generalised forces (3 q,) of `forces` on the rigid rows, for the rigid motions in ``u``.

        Args:
            u: (3 r,) unknowns; their last 3 q entries, the rigid rows, are the unknown translations and rotations of
                handles.
            frame: commanded positions of the handles.
        """
        x, gradient = self.x.copy(), np.zeros_like(u)
        place(u, frame, self._unknowns, x)
        gather_rigid_rows(u, x, self.no_forces(), self.forces, True, frame, self._unknowns, gradient)
        return gradient[3 * len(self._unknowns.free) :]

    def _soften(self, equilibrium: EquilibriumSolver) -> None:
        """Compute d(element forces)/d(hourglass scale), if the hourglass scales depend on strains."""
        self.softening = equilibrium.whole.softening
        if not len(self.softening):
            return
        # the force is linear in the scale
        sides = [self._corner_forces(self.volumes.table, None, self.scale + half) for half in (0.5, -0.5)]
        self._softened = sides[0] - sides[1]

    def reach(self, motion: Array, multipliers: Array) -> float:
        """Return the largest displacement [m] of a motion (n, 3) [m] and a change of the multipliers (k,)."""
        return max(np.abs(motion).max(initial=0.0), self.joint.metres(multipliers))

    def _scale_change(self, motion: Array) -> Array:
        """Return the derivative (m,) of the hourglass scales along a displacement (n, 3) [m]."""
        step, sides = self.SPACING * self.body.size / max(np.abs(motion).max(initial=0.0), 1e-300), []
        for sign in (step, -step):
            sides.append(self.scale.copy())
            given = self.softening, self.end.operators.shape, self.body.material, self.body.table
            update_hourglass_scales(self.x + sign * motion, *given, sides[-1])
        return difference(*sides, 2.0 * step)

    def _turn_forces(self, unknowns: Array) -> Array:
        """Return the change (3 q,) of generalised forces on rigid rows along ``unknowns`` at constant vertex forces."""
        step = self.TURN * self.body.size / max(np.abs(unknowns).max(initial=0.0), 1e-300)
        sides = [self.rigid_part(self.u + sign * unknowns, self.frame) for sign in (step, -step)]
        return difference(*sides, 2.0 * step)

    def _multiply(self, vector: Array) -> Array:
        if self.interrupted is not None and self.interrupted():
            raise GdfeError(ENDED)
        rows = 3 * self._unknowns.rows
        unknowns, multipliers = vector[:rows], vector[rows:] * self._weights
        forces, change = self.product(self.find_displacements(unknowns), multipliers)
        gradient = self.gather_forces(forces)
        if self._motion.size:
            gradient[3 * len(self._unknowns.free) :] += self._turn_forces(unknowns)
        return np.concatenate([gradient, (multipliers - change) / self._weights])

    def _precondition(self, vector: Array) -> Array:
        """Solve with the factor of the tangent; the forces include changes of the multipliers, which stay unchanged."""
        rows = 3 * self._unknowns.rows
        gradient, multipliers = vector[:rows], vector[rows:]
        if len(multipliers):
            forces, _ = self._beside(np.zeros_like(self.x), multipliers * self._weights)
            gradient = gradient - self.gather_forces(forces)
        found = np.zeros_like(gradient)
        self._level.solve(np.ascontiguousarray(gradient), found)
        return np.concatenate([found, multipliers])

    def _beside(self, motion: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return the result of `product` without the contribution of the elements."""
        largest = self.reach(motion, multipliers)
        if largest == 0.0 or not len(self.actuation.table.address):
            return np.zeros_like(motion), np.zeros_like(multipliers)
        step, sides = self.spacing / largest, []
        for sign in (step, -step):
            x = self.x + sign * motion
            self.joint.hold(self.multipliers + sign * multipliers)
            sides.append((self.term_forces(x), self.joint.updated(x)))
        self.joint.hold(self.multipliers)
        return difference(*sides, 2.0 * step)

    def _sum(self, force: Array) -> Array:
        return vertex_forces(self.body, np.arange(len(self.x), dtype=np.int32), force)
