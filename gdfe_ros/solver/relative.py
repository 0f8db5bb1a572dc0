# SPDX-License-Identifier: Apache-2.0
"""Equilibrium of desired shapes for the ``relative`` policy: the paper as published (Eqs. 1-10, Algorithm 1).

What the paper leaves open is read as DESIGN 4 states: R is the proper rotation; V^V is the current shape scaled to
its rest volume; V^v is the V^V of the last converged step in the element's own frame; alpha = eps_p / eps_c, clipped
to [0, 1] and 0 in the first step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.materials.tensor import (
    cofactor,
    determinant,
    rotation_from_stretch_sum,
    squared_norm,
    stretch_sum,
)
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.actuation import Actuation
from gdfe_ros.solver.anderson import Anderson
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import Deadline
from gdfe_ros.solver.descents import Observer
from gdfe_ros.solver.element_state import mean_gradient
from gdfe_ros.solver.fields import corner_forces, store_energies, strain_states, volume_pressures
from gdfe_ros.solver.global_matrix import Factorisation, GlobalMatrix, assemble_centring, close_coupling
from gdfe_ros.solver.outcome import Outcome, State
from gdfe_ros.solver.quasi_newton import largest
from gdfe_ros.solver.scope import Movable
from gdfe_ros.solver.shape_factor import shape_factors
from gdfe_ros.solver.unknowns import gather_rows, place

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
        patience: iterations after which a shorter motion is the better idea.
    """

    patience = 120

    def __init__(self, body: Body, actuation: Actuation | None = None, *, library: Factorisation | None = None) -> None:
        self._body = body
        self._grown = actuation.grown if actuation else None
        self.matrix = GlobalMatrix(assemble_centring(body.shape), body.unknowns, library=library)
        given = np.array([np.nan if material.omega is None else material.omega for material in body.materials])
        self._given = given[body.material]
        corners = body.rest[body.cells]
        self._rest = np.ascontiguousarray(corners - corners.mean(axis=1, keepdims=True))
        self._ungrown = self._rest.copy()
        self._difference = np.zeros_like(self._rest)
        self.reset()

    def observe(self, observer: Observer | None) -> None:
        """Do nothing: there is no energy to see."""

    def reset(self) -> None:
        """Forget the captured shapes and strains."""
        count = len(self._body.material)
        self._captured = self._rest.copy()
        self._captured_strain = np.zeros(count)
        self.omega, strain = self._factors(self._body.rest)
        self._solved = self._body.rest, strain, False

    def accept(self) -> None:
        """Capture the volume-conserving shapes and strains of the last solve for Eq. 9, where it converged."""
        x, strain, converged = self._solved
        if not converged:
            return
        _capture_shapes(x, self._body.shape, self._captured)
        self._captured_strain = strain

    def state(self) -> State:
        """Return what the formulas of the ``energy`` policy give at the shape of the last solve (DESIGN 4)."""
        body, x = self._body, self._solved[0]
        pressure = volume_pressures(body, x)
        force, energies = corner_forces(body, x, pressure)
        stored, ratio = np.empty_like(energies), np.empty_like(energies)
        elements = np.arange(len(energies), dtype=np.int32)
        store_energies(x, elements, body.shape, body.material, body.table, pressure, energies, stored, ratio, False)
        return State(float(stored.sum()), float(ratio.min()), force)

    @property
    def skipped(self) -> dict[str, int]:
        """Nothing: every element is compared with its desired shape in every iteration."""
        return {}

    def prepare(self, base: NDArray[np.float64]) -> Movable:
        """Choose what the next solve moves: everything."""
        return Movable.all_of(self._body.unknowns, self.matrix)

    def solve(
        self,
        start: NDArray[np.float64],
        base: NDArray[np.float64],
        *,
        tolerance: float,
        limit: int,
        deadline: Deadline | None = None,
        ratio: float = 0.0,
    ) -> Outcome:
        """Find the equilibrium of shapes; arguments as in :meth:`EnergyEquilibrium.solve`, ``ratio`` is not used."""
        body, unknowns = self._body, self._body.unknowns
        self._grow()
        count = len(unknowns.free)
        x = start.copy()
        x[unknowns.prescribed] = base[unknowns.prescribed]
        first = unknowns.plate_vertices[unknowns.plate_start[:-1]]
        u = np.vstack([start[unknowns.free], (start[first] - base[first]) * unknowns.plate_axes])
        gradient, step = np.zeros_like(u), np.zeros_like(u)
        anderson, residual = Anderson(), np.inf
        for iteration in range(limit + 1):
            place(u.ravel(), base, unknowns, x)
            self.omega, strain = self._factors(x)
            self._compare(x, strain)
            gather_rows(self._difference, unknowns, gradient.reshape(-1))
            self.matrix.solve(gradient[:count], step[:count])
            close_coupling(gradient.reshape(-1), self.matrix.coupling, step.reshape(-1))
            residual = float(largest(step.reshape(-1))) / (SAFETY * body.size)
            late = deadline is not None and deadline.passed()
            if residual <= tolerance or late or iteration == limit:
                break
            u = anderson.next(u.ravel(), -step.ravel()).reshape(u.shape)
        self._solved = x, strain, residual <= tolerance
        if residual <= tolerance:
            return Outcome(x, True, iteration, residual)
        reason = "the deadline passed" if late else f"stopped after {limit} iterations"
        message = f"{reason}: about {residual:.3g} of the body's size from equilibrium, tolerance {tolerance:.3g}"
        return Outcome(x, False, iteration, residual, message)

    def _grow(self) -> None:
        """Stretch the rest shapes that Eq. 9 turns into desired shapes."""
        if self._grown is not None:
            cells = self._grown.cells
            self._rest[cells] = self._ungrown[cells] @ self._grown.stretch

    def _factors(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return omega and the equivalent strain of each element (Algorithm 1)."""
        body, values = self._body, np.empty((4, len(self._given)))
        strain_states(x, body.shape, body.material, body.table, values)
        omega = shape_factors(values[3])
        return np.where(np.isnan(self._given), omega, self._given), values[0]

    def _compare(self, x: NDArray[np.float64], strain: NDArray[np.float64]) -> None:
        alpha = np.clip(self._captured_strain / np.maximum(strain, 1e-12), 0.0, 1.0)
        _shape_differences(x, self._body.shape, self._rest, self._captured, alpha, self.omega, self._difference)


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
