# SPDX-License-Identifier: Apache-2.0
"""Equilibrium of desired shapes for the ``relative`` policy: the paper as published (Eqs. 1-10, Algorithm 1).

What the paper leaves open is read as follows: R is the proper rotation; V^V is the current shape scaled to
its rest volume; V^v is the V^V of the last converged step in the element's own frame; alpha = eps_p / eps_c where
that is at most 1 (see `blend`), and 0 in the first step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.constraints import Pose
from gdfe_ros.materials.tensor import (
    cofactor,
    determinant,
    rotation_from_stretch_sum,
    squared_norm,
    stretch_sum,
)
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.anderson import Anderson
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.active_set import Movable
from gdfe_ros.solver.descent.minimiser import Observer
from gdfe_ros.solver.descent.quasi_newton import largest
from gdfe_ros.solver.elements.fields import corner_forces, store_energies, strain_states, volume_pressures
from gdfe_ros.solver.elements.measures import mean_gradient
from gdfe_ros.solver.elements.operators import Operators
from gdfe_ros.solver.equilibrium.predictor import Prediction, Predictor
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix, Factorisation, assemble_centring
from gdfe_ros.solver.matrix.coupling import close_coupling
from gdfe_ros.solver.matrix.unknowns import gather_rigid_rows, gather_rows, place
from gdfe_ros.solver.reactions import handle_reactions
from gdfe_ros.solver.relative.shape_factor import shape_factors
from gdfe_ros.solver.solution import Increment, Solution
from gdfe_ros.solver.state import ShapeState, State, Summary
from gdfe_ros.solver.terms.actuation import Actuation

SAFETY = 0.01
"""One step of the fixed point falls short of the distance to its limit by up to this factor."""
LEAST_VOLUME = 1e-3
"""Volume ratio below which V^V is no longer scaled up further; of an inverted element the size of its volume counts,
or it would be blown up without end."""


class RelativeEquilibrium:
    """Finds positions at which every element is as close as possible to its desired shape (Eq. 3).

    Args:
        body: the discretised body.
        actuation: growth alone, which enters the desired shapes: this policy knows no forces; None for nothing.
        library: what factors the constant matrix; None chooses.

    Attributes:
        matrix: the constant matrix.
        handles: the kinematics of the handles.
        patience: iterations after which a shorter motion is the better idea.
    """

    patience = 120

    def __init__(self, body: Body, actuation: Actuation | None = None, *, library: Factorisation | None = None) -> None:
        self._body, self._actuation = body, actuation or Actuation(body)
        self.matrix = ConstantMatrix(assemble_centring(body.shape), body.rest, body.unknowns, library=library)
        self.handles = HandleMotions(body)
        self._movable = Movable.all_of(body.unknowns, self.matrix)
        self._predictor = Predictor(body, self.handles)
        given = np.array([np.nan if material.omega is None else material.omega for material in body.materials])
        self._given = given[body.material]
        corners = body.rest[body.cells]
        self._rest = np.ascontiguousarray(corners - corners.mean(axis=1, keepdims=True))
        self._difference = np.zeros_like(self._rest)

    def observe(self, observer: Observer | None) -> None:
        """Do nothing: there is no energy to see."""

    def at_rest(self) -> State:
        """Return the state at rest: nothing captured, no strain."""
        body, loose = self._body, np.zeros((len(self._body.unknowns.slides), 3))
        operators, commands = self._actuation.growths.ungrown, dict(self._actuation.neutral)
        poses = {handle.name: Pose() for handle in body.handles}
        omega, strain = self._factors(body.rest, operators)
        return State(
            positions=body.rest,
            base=body.rest,
            poses=poses,
            commands=commands,
            slides=loose,
            turns=loose,
            orientation=self.handles.rotations(poses, loose),
            terms={},
            shapes=ShapeState(captured=self._rest, strain=np.zeros_like(strain), omega=omega),
            operators=operators,
            balance=None,
            summary=Summary(
                converged=False,
                residual=0.0,
                energy=0.0,
                min_det=1.0,
                reactions={handle.name: np.zeros(6) for handle in body.handles},
                actuators=self._actuation.states(body.rest, commands, operators),
            ),
        )

    def solve(self, problem: Increment, start: State) -> Solution:
        """Find the equilibrium of shapes for ``problem`` from ``start``, which stays as it is."""
        base = self.handles.base(problem.poses, start.poses, start.base)
        change = start.change_to(problem.commands)
        prediction = self._predictor.predict(start, base, change, self._movable)
        operators = self._actuation.growths.at(problem.commands, start.operators)
        x, slides, omega, strain, iteration, residual, late = self._iterate(problem, start, base, prediction, operators)
        converged, shapes = residual <= problem.tolerance, start.shapes
        shapes = ShapeState(captured=shapes.captured, strain=shapes.strain, omega=omega)
        message = ""
        if converged:
            captured = np.empty_like(self._rest)
            _capture_shapes(x, operators.shape, captured)
            # Kept as it would be without growth, so that it grows and shrinks with the element.
            shapes = ShapeState(captured=self._stretched(captured, operators, back=True), strain=strain, omega=omega)
        else:
            reason = "the deadline passed" if late else f"stopped after {problem.limit} iterations"
            message = (
                f"{reason}: about {residual:.3g} of the body's size from equilibrium, tolerance {problem.tolerance:.3g}"
            )
        found = start.with_(
            positions=x,
            base=base,
            poses=problem.poses,
            commands=problem.commands,
            slides=slides,
            shapes=shapes,
            operators=operators,
            summary=self._summary(x, operators, problem, converged=converged, residual=residual, message=message),
        )
        return Solution(
            state=found,
            iterations=iteration,
            cut=late and not converged,
            began=prediction.positions,
            tolerance=problem.tolerance,
            active=self._movable,
        )

    def accept(self, solution: Solution, previous: State) -> State:
        """Return the state that follows ``previous`` with a solution."""
        found = solution.state
        return found.with_(motion=self._predictor.motion(previous, found, previous.change_to(found.commands)))

    def skipped(self, solution: Solution) -> dict[str, int]:
        """Return nothing: every element is compared with its desired shape in every iteration."""
        return {}

    def _iterate(
        self,
        problem: Increment,
        start: State,
        base: NDArray[np.float64],
        prediction: Prediction,
        operators: Operators,
    ) -> tuple[NDArray, NDArray, NDArray, NDArray, int, float, bool]:
        """Iterate to a fixed point; return positions, slides, omega, strains, iterations, residual, if it was late."""
        body, unknowns, frame = self._body, self._body.unknowns, self.handles.frame(base)
        count, x = len(unknowns.free), prediction.positions.copy()
        x[unknowns.prescribed] = base[unknowns.prescribed]
        u = np.vstack([prediction.positions[unknowns.free], prediction.slides * unknowns.slides])
        gradient, step, none = np.zeros_like(u), np.zeros_like(u), np.zeros((0, 3))
        rest, captured = self._stretched(self._rest, operators), self._stretched(start.shapes.captured, operators)
        anderson, residual = Anderson(), np.inf
        for iteration in range(problem.limit + 1):
            place(u.ravel(), frame, unknowns, x)
            omega, strain = self._factors(x, operators)
            alpha = blend(start.shapes.strain, strain)
            _shape_differences(x, operators.shape, rest, captured, alpha, omega, self._difference)
            gather_rows(self._difference, unknowns, gradient.reshape(-1))
            gather_rigid_rows(u.ravel(), x, self._difference, none, False, frame, unknowns, gradient.reshape(-1))
            self.matrix.solve(gradient[:count], step[:count])
            close_coupling(gradient.reshape(-1), self.matrix.coupling, step.reshape(-1))
            residual = float(largest(step.reshape(-1))) / (SAFETY * body.size)
            late = iteration > 0 and problem.deadline is not None and problem.deadline.passed()
            if residual <= problem.tolerance or late or iteration == problem.limit:
                break
            u = anderson.next(u.ravel(), -step.ravel()).reshape(u.shape)
        return x, u[count:].copy(), omega, strain, iteration, residual, late

    def _summary(
        self,
        x: NDArray[np.float64],
        operators: Operators,
        problem: Increment,
        *,
        converged: bool,
        residual: float,
        message: str,
    ) -> Summary:
        """Return what the formulas of the ``energy`` policy give at the positions: this policy has no newtons."""
        body = self._body
        pressure = volume_pressures(body, x, operators=operators)
        force, energies = corner_forces(body, x, pressure, operators=operators)
        stored, least = np.empty_like(energies), np.empty_like(energies)
        elements = np.arange(len(energies), dtype=np.int32)
        shape, material = operators.shape, body.material
        store_energies(x, elements, shape, material, body.table, pressure, energies, stored, least, False)
        return Summary(
            converged=converged,
            residual=residual,
            energy=float(stored.sum()),
            min_det=float(least.min()),
            reactions=handle_reactions(body, x, force),
            actuators=self._actuation.states(x, problem.commands, operators),
            message=message,
        )

    def _stretched(
        self, shapes: NDArray[np.float64], operators: Operators, *, back: bool = False
    ) -> NDArray[np.float64]:
        """Return shapes (m, 8, 3) grown with their elements, or ``back`` to no growth."""
        cells = self._actuation.growths.cells
        if not len(cells):
            return shapes
        grown = shapes.copy()
        grown[cells] = shapes[cells] @ (np.linalg.inv(operators.stretch) if back else operators.stretch)
        return grown

    def _factors(self, x: NDArray[np.float64], operators: Operators) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return omega and the equivalent strain of each element (Algorithm 1)."""
        body, values = self._body, np.empty((4, len(self._given)))
        strain_states(x, operators.shape, body.material, body.table, values)
        omega = shape_factors(values[3])
        return np.where(np.isnan(self._given), omega, self._given), values[0]


def blend(before: NDArray[np.float64], now: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return alpha = eps_p / eps_c of Eq. 9, or its inverse where a strain has become smaller.

    The paper has loading in mind, where the ratio is at most 1. Of an element that is let go the captured shape must
    not stay the desired one: as its strain vanishes so does alpha, and it comes home.
    """
    most = np.maximum(before, now)
    return np.minimum(before, now) / np.maximum(most, 1e-12)


@internal
def _frame(x, shape, e):
    """Return the proper rotation of an element and the factor that scales it to its rest volume."""
    f = mean_gradient(x, shape, e)
    c = cofactor(f)
    j = determinant(f, c)
    first = squared_norm(f)
    s = stretch_sum(first, squared_norm(c), j)
    r, _ = rotation_from_stretch_sum(f, c, first, s, j)
    return r, max(abs(j), LEAST_VOLUME) ** (-1.0 / 3.0)


@kernel
def _shape_differences(x, shape, rest, captured, alpha, omega, difference):
    """Write Omega_e (N V - V^B) (m, 8, 3) with the desired shapes of Eqs. 9 and 10."""
    centre = np.empty(3)
    for e in range(len(shape.cells)):
        r, scale = _frame(x, shape, e)
        centre[:] = 0.0
        for a in range(8):
            for i in range(3):
                centre[i] += 0.125 * x[shape.cells[e, a], i]
        for a in range(8):
            p0 = (1.0 - alpha[e]) * rest[e, a, 0] + alpha[e] * captured[e, a, 0]
            p1 = (1.0 - alpha[e]) * rest[e, a, 1] + alpha[e] * captured[e, a, 1]
            p2 = (1.0 - alpha[e]) * rest[e, a, 2] + alpha[e] * captured[e, a, 2]
            for i in range(3):
                current = x[shape.cells[e, a], i] - centre[i]
                previous = r[3 * i] * p0 + r[3 * i + 1] * p1 + r[3 * i + 2] * p2
                desired = omega[e] * previous + (1.0 - omega[e]) * scale * current
                difference[e, a, i] = shape.volume[e] * (current - desired)


@kernel
def _capture_shapes(x, shape: ShapeOperators, captured):
    """Write R^T V^V (m, 8, 3), the volume-conserving shapes in the elements' own frames."""
    centre = np.empty(3)
    for e in range(len(shape.cells)):
        r, scale = _frame(x, shape, e)
        centre[:] = 0.0
        for a in range(8):
            for i in range(3):
                centre[i] += 0.125 * x[shape.cells[e, a], i]
        for a in range(8):
            v = shape.cells[e, a]
            y0, y1, y2 = x[v, 0] - centre[0], x[v, 1] - centre[1], x[v, 2] - centre[2]
            for i in range(3):
                captured[e, a, i] = scale * (r[i] * y0 + r[3 + i] * y1 + r[6 + i] * y2)
