# SPDX-License-Identifier: Apache-2.0
"""Loads as terms: dead loads, and follower pressures.

A dead load has forces of constant magnitude and direction, and the energy E = -s sum_v f_v . (x_v - X_v).

A follower pressure p acts normal to the deformed faces. Node a of the faces gets the force p f_a, with f_a = int N_a n
dA over the deformed faces. Let V be the volume of the cones from the faces to a fixed point, V = 1/3 int x . n dA. Then
f_a = dV/dx_a + b_a, where b_a is not zero only at nodes on open edges of the faces. The first part has the energy -p V.
The second part has none: with open edges, the work of a pressure depends on the path. The forces p b_a, with the energy
-p b_a . x_a, are therefore constant in each minimisation. They are updated between minimisations until they agree with
the present positions.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.load import Load, PressureLoad
from gdfe_ros.compiled import kernel
from gdfe_ros.constraints import Pose
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved, State
from gdfe_ros.solver.terms.multiplier import Anderson, UpdatedTerm
from gdfe_ros.solver.terms.term import Term, as_arrays, term_kernel
from gdfe_ros.solver.terms.volume import COUNT, FACES, NODES, PRODUCTS, face_forces, pack_faces, volume_curvature
from gdfe_ros.solver.vectors import NEGLIGIBLE, Array

PRESSURE, VOLUME, APEX, EDGE = 0, 1, 2, 5
"""Offsets in ``reals`` of p [Pa], a volume [m^3] that is subtracted to keep energies small, the cones' common point
(3,) [m], and the vectors b (k, 3) [m^2] of the nodes on open edges."""


@kernel
def pressure_energy(x, reals, integers, force, size):
    """Return the energy [J] -p (V + sum_a b_a . x_a) and add its gradient; `term_kernel` needs this signature."""
    pressure = reals[PRESSURE]
    if pressure == 0.0:
        return 0.0
    volume = face_forces(x, integers, reals[APEX:EDGE], -pressure, 0.0, force)
    first = FACES + integers[NODES] * integers[COUNT]
    for k in range(len(integers) - first):
        for i in range(3):
            own = reals[EDGE + 3 * k + i]
            volume += own * (x[integers[first + k], i] - reals[APEX + i])
            force[integers[first + k], i] -= pressure * own
    size[0] += abs(pressure * volume)
    return -pressure * (volume - reals[VOLUME])


@term_kernel
def pressure_entry(x, n, reals, k, integers, i, force, size):
    """Call `pressure_energy` with the raw pointers that the terms' kernels receive."""
    return pressure_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class PressureTerm(UpdatedTerm):
    """A follower pressure with its commanded factor.

    Args:
        load: the pressure of the scene.
        body: the body on whose faces it acts.
    """

    FINE = 1e-2
    """Allowed displacement by the last change of the forces p b, divided by the tolerance."""
    GROWTH = 1e3
    """Growth factor of the residual up to which Anderson acceleration keeps its history. It is large, because plain
    updates of b may diverge.
    """

    kernel, stored = pressure_entry, "edge"

    def __init__(self, load: PressureLoad, body: Body) -> None:
        self._load, self._faces = load, load.quads.astype(np.int32)
        own, head = np.unique(self._faces), pack_faces(self._faces)
        far = body.rest[own].min(axis=0) - body.size * np.array([1.0, 2.0, 3.0])
        super().__init__(load.name, np.concatenate([[0.0, 0.0], far]), head)
        areas = self._sum_forces(body.rest, 0.0, 1.0)
        self._area = float(np.abs(areas).sum())
        beside = np.abs(areas - self._sum_forces(body.rest, 1.0, 0.0)).max(axis=1) > NEGLIGIBLE * self._area
        self._edge = np.flatnonzero(beside).astype(np.int32)
        middle = body.rest[self._edge if len(self._edge) else own].mean(axis=0)
        numbers = np.concatenate([[0.0, 0.0], middle, np.zeros(3 * len(self._edge))])
        super().__init__(load.name, numbers, np.concatenate([head, self._edge]).astype(np.int32))
        self.exact = self.conservative = not len(self._edge)
        self._rest, self.size, self._softness, self._last = body.rest, body.size, 0.0, None

    @property
    def updates(self) -> bool:
        """Whether there are open edges, whose forces follow the positions."""
        return len(self._edge) > 0 and self.reals[PRESSURE] != 0.0

    @property
    def own_multipliers(self) -> Array:
        """The vectors b (k, 3) [m^2] in use, a view."""
        return self.reals[EDGE:].reshape(-1, 3)

    def _sum_forces(self, x: Array, of_volume: float, of_area: float) -> Array:
        """Return ``of_volume`` times dV/dx_a plus ``of_area`` times f_a for all nodes a, (n, 3) [m^2]."""
        force = np.zeros_like(x)
        face_forces(x, self.integers, self.reals[APEX:EDGE], of_volume, of_area, force)
        return force

    def renew(self, positions: Array) -> Array:
        """Return the vectors b (k, 3) [m^2] of the nodes on open edges at ``positions`` (n, 3) [m]."""
        return self._sum_forces(positions, -1.0, 1.0)[self._edge]

    def _volume(self, x: Array) -> float:
        return float(face_forces(x, self.integers, self.reals[APEX:EDGE], 0.0, 0.0, np.zeros((0, 3))))

    def fit(self, matrix: ConstantMatrix) -> None:
        """Compute the displacement [m/N] by a force of 1 N in total, distributed over the faces like the pressure."""
        areas = self._sum_forces(self._rest, 0.0, 1.0)
        self._softness = matrix.compliance(areas) / self._area**2

    def couplings(self) -> NDArray[np.int32]:
        """Return the nodes of the faces (q, c)."""
        return self._faces

    def tangents(self, positions: Array) -> Array:
        """Return the tangents -p d2V/dx2 [N/m] of the faces, (q, 3 c, 3 c); without the part of open edges."""
        count, nodes = self._faces.shape
        found = np.zeros((count, 3 * nodes, 3 * nodes))
        if self.reals[PRESSURE]:
            given = positions, self.integers, self.reals[APEX:EDGE], PRODUCTS[nodes]
            volume_curvature(*given, -self.reals[PRESSURE], found)
        return found

    def neutral(self) -> Saved:
        """Return the stored state before the first solve: no swept volume."""
        return {"swept": np.zeros(1), "edge": np.zeros_like(self.own_multipliers)}

    def set_targets(self, poses: Mapping[str, Pose], last: State) -> None:
        """Store the previous positions, from which the swept volume is counted."""
        self._last = self._rest if last is None else last.positions

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: Array, ratio: float) -> None:
        """Set the pressure, and the forces at open edges as they are at ``positions``."""
        numbers, self._anderson, self.errors = self.reals, Anderson(self.GROWTH), []
        numbers[PRESSURE] = commands[self.name] * self._load.pressure
        self.own_multipliers[...] = self.renew(positions)
        numbers[VOLUME] = self._volume(positions)
        numbers[VOLUME] += np.vdot(self.own_multipliers, positions[self._edge] - numbers[APEX:EDGE])
        self._swept = float(saved["swept"][0])

    def update(self, positions: Array) -> float:
        """Update the vectors b; return the change of the forces as a displacement [m], divided by `FINE`."""
        change = (self.renew(positions) - self.own_multipliers).ravel()
        self.own_multipliers[...] = self._anderson.next(self.own_multipliers.ravel(), change).reshape(-1, 3)
        moved = abs(self.reals[PRESSURE]) * np.linalg.norm(change.reshape(-1, 3), axis=1).sum()
        self.errors.append(float(moved) * self._softness / self.FINE)
        return self.errors[-1]

    def finish(self, saved: Saved, positions: Array) -> Saved:
        """Return the state to store: the volume that the faces have swept, and the vectors b."""
        return {"swept": np.array([self._sweep(positions)]), "edge": self.own_multipliers.copy()}

    def _sweep(self, positions: Array) -> float:
        """Return the volume [m^3] that the faces have swept since the beginning of the run.

        It is the integral of sum_a f_a . dx_a. The part of open edges depends on the path and is integrated by the
        trapezoidal rule.
        """
        last = self._last
        mean = 0.5 * (self.renew(last) + self.renew(positions))
        along = float(np.vdot(mean, (positions - last)[self._edge]))
        return self._swept + self._volume(positions) - self._volume(last) + along

    @property
    def per_metre(self) -> Array:
        """The order of magnitude (3 k,) [m] of the change of b per 1 m: the size of the faces."""
        return np.full(self.multipliers.shape, np.sqrt(self._area))

    def potential(self, positions: Array, command: float) -> tuple[float, float]:
        """Return minus the work [J] of the present pressure on the swept volume, and its derivative by the command."""
        slope = -self._load.pressure * self._sweep(positions)
        return command * slope, slope


FACTOR, FORCES = range(2)
"""Offsets in ``reals`` of the factor s, and of the forces f_v [N], each followed by its rest position X_v [m]."""


@kernel
def dead_load_energy(x, reals, integers, force, size):
    """Return the energy [J] of a dead load and add its gradient; `term_kernel` needs this signature."""
    energy, factor = 0.0, reals[FACTOR]
    if factor == 0.0:
        return 0.0
    for i in range(len(integers)):
        v = integers[i]
        for axis in range(3):
            pull = factor * reals[FORCES + 6 * i + axis]
            work = pull * (x[v, axis] - reals[FORCES + 6 * i + 3 + axis])
            energy -= work
            size[0] += abs(work)
            force[v, axis] -= pull
    return energy


@term_kernel
def dead_load_entry(x, n, reals, k, integers, i, force, size):
    """Call `dead_load_energy` with the raw pointers that the terms' kernels receive."""
    return dead_load_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class DeadLoadTerm(Term):
    """A load with its commanded factor.

    Args:
        load: load of the scene.
        body: the body on which it acts.
    """

    kernel, exact = dead_load_entry, True

    def __init__(self, load: Load, body: Body) -> None:
        self._forces, self._rest = load.forces(body.rest, body.cells), body.rest
        acted = np.flatnonzero(self._forces.any(axis=1)).astype(np.int32)
        numbers = np.concatenate([self._forces[acted], body.rest[acted]], axis=1).ravel()
        super().__init__(load.name, np.concatenate([[0.0], numbers]), acted)

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: Array, ratio: float) -> None:
        """Set the factor of the load."""
        self.reals[FACTOR] = commands[self.name]

    def potential(self, positions: Array, command: float) -> tuple[float, float]:
        """Return the potential [J] at ``positions`` (n, 3) [m] and its derivative with respect to ``command``."""
        slope = -float(np.vdot(self._forces, positions - self._rest))
        return command * slope, slope
