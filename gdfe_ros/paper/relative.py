# SPDX-License-Identifier: Apache-2.0
"""Equilibrium of desired shapes for the ``relative`` policy: the paper as published (Eqs. 1-10, Algorithm 1).

The paper leaves four symbols open. Here, R is the proper rotation of the element's polar decomposition. V^V is the
element's current shape, scaled to its rest volume. V^v is the shape V^V of the last converged step, in the element's
own frame. The factor alpha is eps_p / eps_c, or the inverse of this ratio if the ratio exceeds 1 (see `blend`). In the
first step, alpha is 0.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.materials.tensor import rotation
from gdfe_ros.mesh.cells.operators import ShapeOperators
from gdfe_ros.paper.shape_factor import shape_factors
from gdfe_ros.results.element_fields import corner_forces, strain_states, volume_pressures
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.barrier import tell_flat
from gdfe_ros.solver.elements.blocks import Operators
from gdfe_ros.solver.elements.corners import mean_gradient
from gdfe_ros.solver.equilibrium.predictor import Predictor
from gdfe_ros.solver.forces.actuation import Actuation, handle_reactions
from gdfe_ros.solver.forces.pressures import store_energies
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix, close_coupling, scatter
from gdfe_ros.solver.matrix.unknowns import gather_rigid_rows, gather_rows, place
from gdfe_ros.solver.minimise.minimiser import Observer
from gdfe_ros.solver.outcome import Outcome
from gdfe_ros.solver.solution import Increment, Solution
from gdfe_ros.solver.state import ShapeState, State, Summary
from gdfe_ros.solver.terms.multiplier import Anderson
from gdfe_ros.solver.vectors import Array, largest

LEAST_VOLUME = 1e-3
"""Lower bound of the volume ratio from which the scale of V^V is computed; without this bound, the scale could become
infinite. For an inverted element, the absolute value of the ratio is used.
"""


def assemble_centring(shape: ShapeOperators) -> sparse.csc_matrix:
    """Return the paper's A^T A = sum_e V_e N with N = I - 1/8 (Eq. 3), (n, n)."""
    return scatter(shape.volume[:, None, None] * (np.eye(8) - 0.125), shape.cells).tocsc()


def blend(before: Array, now: Array) -> Array:
    """Return alpha = eps_p / eps_c of Eq. 9, or its inverse for a strain that has decreased.

    The paper considers loading, where the ratio is at most 1. On unloading, alpha must vanish with the strain.
    Otherwise the captured shape would remain the desired one, and the element would not return to its rest shape.
    """
    most = np.maximum(before, now)
    return np.minimum(before, now) / np.maximum(most, 1e-12)


@internal
def _frame(x, shape, e):
    """Return the proper rotation of an element, and the factor that scales its current shape to its rest volume."""
    r, _, j = rotation(mean_gradient(x, shape, e))
    return r, max(abs(j), LEAST_VOLUME) ** (-1.0 / 3.0)


@internal
def _centre(x, cells, e, centre):
    """Write the mean position of the corners of element ``e`` to ``centre`` (3,)."""
    centre[:] = 0.0
    for a in range(8):
        for i in range(3):
            centre[i] += 0.125 * x[cells[e, a], i]


@kernel
def shape_differences(x, shape, rest, captured, alpha, omega, difference):
    """Write Omega_e (N V - V^B) (m, 8, 3), with rest volume Omega_e and desired shape V^B of Eqs. 9 and 10."""
    centre = np.empty(3)
    for e in range(len(shape.cells)):
        r, scale = _frame(x, shape, e)
        _centre(x, shape.cells, e, centre)
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
def capture_shapes(x, shape: ShapeOperators, captured):
    """Write R^T V^V (m, 8, 3) [m], the shapes of rest volume in the elements' own frames, to ``captured``."""
    centre = np.empty(3)
    for e in range(len(shape.cells)):
        r, scale = _frame(x, shape, e)
        _centre(x, shape.cells, e, centre)
        for a in range(8):
            v = shape.cells[e, a]
            y0, y1, y2 = x[v, 0] - centre[0], x[v, 1] - centre[1], x[v, 2] - centre[2]
            for i in range(3):
                captured[e, a, i] = scale * (r[i] * y0 + r[3 + i] * y1 + r[6 + i] * y2)


class RelativeEquilibrium:
    """Equilibrium solver: finds positions at which every element is as close as possible to its desired shape (Eq. 3).

    Args:
        body: the discretised body.
        actuation: the growths, which change the desired shapes; None if there are none. Other actuators are not
            possible, because this policy has no forces.

    Attributes:
        matrix: the constant matrix.
        handles: the kinematics of the handles.
        patience: number of iterations after which a solve ends without success and a shorter increment is tried.
    """

    SAFETY = 0.01
    """Assumed least ratio of the length of a fixed-point step to the distance to the fixed point."""

    patience = 120

    def __init__(self, body: Body, actuation: Actuation | None = None) -> None:
        self._body, self._actuation = body, actuation or Actuation(body)
        self.matrix = ConstantMatrix(assemble_centring(body.shape), body.rest, body.unknowns)
        self.handles = HandleMotions(body)
        self._predictor = Predictor(body, self.handles, self.matrix)
        given = np.array([np.nan if material.omega is None else material.omega for material in body.materials])
        self._given = given[body.material]
        corners = body.rest[body.cells]
        self._rest = np.ascontiguousarray(corners - corners.mean(axis=1, keepdims=True))
        self._difference = np.zeros_like(self._rest)

    def observe(self, observer: Observer | None) -> None:
        """Do nothing: this policy has no energy to observe."""

    @property
    def remarks(self) -> list[str]:
        """No remarks on accuracy: this policy never needs a tangent."""
        return []

    def at_rest(self) -> State:
        """Return the undeformed state; the captured shapes are the rest shapes, with zero strain."""
        omega, strain = self._factors(self._body.rest, self._actuation.growths.ungrown)
        shapes = ShapeState(captured=self._rest, strain=np.zeros_like(strain), omega=omega)
        return self._actuation.rest_state(converged=False, terms={}, shapes=shapes, balance=None)

    def solve(self, problem: Increment, start: State) -> Solution:
        """Find the equilibrium of shapes for ``problem`` from ``start``, which is not modified."""
        base = self.handles.base(problem.poses, start.poses, start.base)
        change = start.change_to(problem.commands)
        predicted = self._predictor.predict(start, base, change).state
        operators = self._actuation.growths.at(problem.commands, start.operators)
        x, slides, omega, strain, iteration, estimate, late = self._iterate(problem, start, predicted, operators)
        converged, shapes = estimate <= problem.tolerance, start.shapes
        shapes = ShapeState(captured=shapes.captured, strain=shapes.strain, omega=omega)
        message = ""
        if converged:
            captured = np.empty_like(self._rest)
            capture_shapes(x, operators.shape, captured)
            # Stored without growth, so that it grows and shrinks with the element.
            shapes = ShapeState(captured=self._stretch(captured, operators, back=True), strain=strain, omega=omega)
        else:
            reason = problem.deadline.reason if late else f"stopped after {problem.limit} iterations"
            message = (
                f"{reason}: about {estimate:.3g} of the body's size from equilibrium, tolerance {problem.tolerance:.3g}"
            )
        found = start.with_(
            positions=x,
            base=base,
            poses=problem.poses,
            commands=problem.commands,
            slides=slides,
            shapes=shapes,
            operators=operators,
            summary=self._summary(x, operators, problem, converged=converged, error_estimate=estimate, message=message),
        )
        return Solution(
            state=found,
            iterations=iteration,
            ended=Outcome.NEAR if converged else Outcome.CUT if late else Outcome.STALLED,
            began=predicted.positions,
        )

    def accept(self, solution: Solution, previous: State) -> State:
        """Return the complete state of ``solution``, which follows the state ``previous``."""
        found = solution.state
        return found.with_(motion=self._predictor.motion(previous, found, previous.change_to(found.commands)))

    def count_skipped(self) -> dict[str, int]:
        """Return no counts: every iteration compares every element with its desired shape."""
        return {}

    def _iterate(
        self, problem: Increment, start: State, predicted: State, operators: Operators
    ) -> tuple[NDArray, NDArray, NDArray, NDArray, int, float, bool]:
        """Iterate the shape factors, desired shapes and positions to a fixed point.

        Returns:
            Positions, free translations, omega, strains, number of iterations, error estimate, and whether the deadline
            passed.
        """
        body, unknowns, frame = self._body, self._body.unknowns, self.handles.frame(predicted.base)
        count, x = len(unknowns.free), predicted.positions.copy()
        x[unknowns.prescribed] = predicted.base[unknowns.prescribed]
        u = np.vstack([predicted.positions[unknowns.free], predicted.slides * unknowns.slides])
        gradient, step, none = np.zeros_like(u), np.zeros_like(u), np.zeros((0, 3))
        rest, captured = self._stretch(self._rest, operators), self._stretch(start.shapes.captured, operators)
        anderson, estimate = Anderson(), np.inf
        for iteration in range(problem.limit + 1):
            place(u.ravel(), frame, unknowns, x)
            omega, strain = self._factors(x, operators)
            alpha = blend(start.shapes.strain, strain)
            shape_differences(x, operators.shape, rest, captured, alpha, omega, self._difference)
            gather_rows(self._difference, unknowns, gradient.reshape(-1))
            gather_rigid_rows(u.ravel(), x, self._difference, none, False, frame, unknowns, gradient.reshape(-1))
            self.matrix.solve(gradient[:count], step[:count])
            close_coupling(gradient.reshape(-1), self.matrix.coupling, step.reshape(-1))
            estimate = float(largest(step.reshape(-1))) / (self.SAFETY * body.size)
            late = iteration > 0 and problem.deadline is not None and problem.deadline.has_passed()
            if estimate <= problem.tolerance or late or iteration == problem.limit:
                break
            u = anderson.next(u.ravel(), -step.ravel()).reshape(u.shape)
        return x, u[count:].copy(), omega, strain, iteration, estimate, late

    def _summary(
        self,
        x: Array,
        operators: Operators,
        problem: Increment,
        *,
        converged: bool,
        error_estimate: float,
        message: str,
    ) -> Summary:
        """Return a summary; energy and reactions follow from the policy ``energy`` at positions ``x`` (n, 3) [m]."""
        body = self._body
        pressure = volume_pressures(body, x, operators=operators)
        force, energies = corner_forces(body, x, pressure, operators=operators)
        stored, least = np.empty_like(energies), np.empty_like(energies)
        elements = np.arange(len(energies), dtype=np.int32)
        shape, material = operators.shape, body.material
        store_energies(x, elements, shape, material, body.table, pressure, energies, stored, least, False)
        if not (converged and least.min() > 0.0):
            converged, message = False, "; ".join(text for text in (message, tell_flat(least)) if text)
        return Summary(
            converged=converged,
            error_estimate=error_estimate,
            energy=float(stored.sum()),
            min_det=float(least.min()),
            reactions=handle_reactions(body, x, force),
            actuators=self._actuation.states(x, problem.commands, operators),
            message=message,
        )

    def _stretch(self, shapes: Array, operators: Operators, *, back: bool = False) -> Array:
        """Apply the growth of the elements to ``shapes`` (m, 8, 3), or remove it if ``back``; return the shapes."""
        cells = self._actuation.growths.cells
        if not len(cells):
            return shapes
        grown = shapes.copy()
        grown[cells] = shapes[cells] @ (np.linalg.inv(operators.stretch) if back else operators.stretch)
        return grown

    def _factors(self, x: Array, operators: Operators) -> tuple[Array, Array]:
        """Return the shape factor omega and the equivalent strain of each element (m,) (Algorithm 1)."""
        body, values = self._body, np.empty((4, len(self._given)))
        strain_states(x, operators.shape, body.material, body.table, values)
        omega = shape_factors(values[3])
        return np.where(np.isnan(self._given), omega, self._given), values[0]
