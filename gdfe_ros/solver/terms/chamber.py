# SPDX-License-Identifier: Apache-2.0
"""Chambers as terms.

A chamber of volume V has the energy -p (V - v) + k/2 (V - v)^2. With k = 0 this is a chamber of given pressure p.
Otherwise it is the augmented Lagrangian of the constraint V = v with the multiplier p. Sums have a fixed order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import ActuatorState, Chamber
from gdfe_ros.compiled import kernel
from gdfe_ros.mesh.triples import corner
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved
from gdfe_ros.solver.terms.multiplier import EFFORT, STIFFNESS, TARGET, EffortTerm
from gdfe_ros.solver.terms.term import as_arrays, share, term_kernel, weighted
from gdfe_ros.solver.terms.volume import FACES, PRODUCTS, face_forces, pack_faces, volume_curvature
from gdfe_ros.solver.vectors import Array

LIMIT = STIFFNESS + 1
"""Offset in ``reals``, after p [Pa], v [m^3] and k [Pa/m^3], of the volume [m^3] above which the chamber counts as
unstable.
"""


@kernel
def chamber_pressure(volume, reals):
    """Return the pressure [Pa] of a chamber of the given ``volume`` [m^3]."""
    return reals[EFFORT] - reals[STIFFNESS] * (volume - reals[TARGET])


@kernel
def chamber_energy(x, reals, integers, force, size):
    """Return the energy [J] of a chamber, infinite beyond its limit, and add its gradient.

    `term_kernel` needs this signature. The first vertex is the apex of the volume's cones, which keeps rounding small.
    """
    apex = x[integers[FACES]]
    volume = face_forces(x, integers, apex, 0.0, 0.0, force)
    change, stiffness = volume - reals[TARGET], reals[STIFFNESS]
    if not abs(volume) <= reals[LIMIT]:
        return np.inf
    pressure = chamber_pressure(volume, reals)
    size[0] += abs(pressure * volume)
    if pressure != 0.0:
        face_forces(x, integers, apex, -pressure, 0.0, force)
    return change * (0.5 * stiffness * change - reals[EFFORT])


@kernel
def carried_energy(x, reals, integers, force, size):
    """Return the energy [J] of a chamber whose corners are points carried by eight vertices each; add its gradient.

    ``reals`` has the vertices' weights after the chamber's own numbers. ``integers`` has the number of points, the
    eight vertices of each point, and the faces between the points.
    """
    count = integers[0]
    points, pulls = np.zeros((count, 3)), np.zeros((count, 3))
    for p in range(count):
        points[p, 0], points[p, 1], points[p, 2] = weighted(x, integers, 1 + 8 * p, reals, LIMIT + 1 + 8 * p, 8)
    energy = chamber_energy(points, reals, integers[1 + 8 * count :], pulls, size)
    for p in range(count):
        share(force, integers, 1 + 8 * p, reals, LIMIT + 1 + 8 * p, 8, corner(pulls, p))
    return energy


@term_kernel
def _carried_entry(x, n, reals, k, integers, i, force, size):
    return carried_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@term_kernel
def _entry(x, n, reals, k, integers, i, force, size):
    return chamber_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class ChamberTerm(EffortTerm):
    """A chamber with a commanded pressure or volume.

    Args:
        chamber: chamber of the scene.
        body: the body around the chamber.

    Attributes:
        actuator: the chamber.
        updates: whether a multiplier keeps the volume.
    """

    LARGEST_INFLATION = 8.0
    """A chamber of given pressure counts as unstable if its volume grows by more than this factor in one solve."""
    RUNNING_AWAY = 3.0 / 16.0
    """A chamber counts as unstable in a failed solve that ends above this fraction of the volume limit."""

    kernel = _entry

    def __init__(self, chamber: Chamber, body: Body) -> None:
        self.actuator, self._body = chamber, body
        reals = np.array([0.0, 0.0, 0.0, math.inf])
        integers = self._faces = pack_faces(chamber.quads)
        self.exact = chamber.points is None
        if (points := chamber.points) is not None:
            self.kernel = _carried_entry
            reals = np.concatenate([reals, points.weights.ravel()])
            integers = np.concatenate([[len(points.corners)], points.corners.ravel(), integers], dtype=np.int32)
        super().__init__(chamber.name, reals, integers)
        self._rest_volume = self._volume(body.rest)
        self.updates, self.unbounded = chamber.constrains, not chamber.constrains
        self._command = chamber.neutral(body.rest)

    def fit(self, matrix: ConstantMatrix) -> None:
        """For a commanded volume, set a penalty in proportion to the body's initial stiffness."""
        if self.updates:
            self.fit_penalty(matrix, self._find_unit_forces(self._body.rest))

    def _find_unit_forces(self, positions: Array) -> Array:
        """Return -dV/dx (n, 3) [m^2]."""
        places, points = self.actuator.at(positions), self.actuator.points
        force = np.zeros_like(places)
        face_forces(places, self._faces, places[self._faces[FACES]], -1.0, 0.0, force)
        if points is not None:
            pulls, force = points.weights[..., None] * force[:, None], np.zeros_like(positions)
            np.add.at(force, points.corners, pulls)
        return force

    def couplings(self) -> NDArray[np.int32]:
        """Return the corners of the faces (k, c); none if other vertices carry them."""
        faces = self.actuator.quads.astype(np.int32)
        return faces if self.exact else faces[:0]

    def tangents(self, positions: Array) -> Array:
        """Return the tangents -p d2V/dx2 [N/m] of the faces, (k, 3 c, 3 c)."""
        count, corners = self.couplings().shape
        found = np.zeros((count, 3 * corners, 3 * corners))
        pressure = chamber_pressure(self._volume(positions), self.reals)
        if pressure and count:
            given = positions, self._faces, positions[self._faces[FACES]], PRODUCTS[corners]
            volume_curvature(*given, -pressure, found)
        return found

    def has_spring(self, positions: Array) -> bool:
        """Return whether the volume is commanded."""
        return self.updates

    def spring(self, positions: Array) -> Array:
        """Return a commanded volume with its penalty k as a spring (n, 3): -sqrt(k) dV/dx."""
        return np.sqrt(self.reals[STIFFNESS]) * self._find_unit_forces(positions)

    def _volume(self, positions: Array) -> float:
        places = self.actuator.at(positions)
        return float(face_forces(places, self._faces, places[self._faces[FACES]], 0.0, 0.0, np.zeros((0, 3))))

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: Array, ratio: float) -> None:
        """Set the command; for a commanded volume, also the initial pressure, extrapolated from the last steps."""
        self._command, numbers = commands[self.name], self.reals
        if self.updates:
            numbers[EFFORT], numbers[TARGET], numbers[LIMIT] = self.guess_effort(saved, ratio), self._command, math.inf
            return
        volume = self._volume(positions)
        numbers[EFFORT], numbers[TARGET] = self._command, volume
        numbers[LIMIT] = self._limit(volume)

    @property
    def area(self) -> float:
        """Order of magnitude [m^2] of the chamber's surface: its volume to the power 2/3."""
        return max(abs(self.reals[TARGET]), self.actuator.least, 1e-30) ** (2.0 / 3.0)

    def renew(self, positions: Array) -> Array:
        """Return the pressure (1,) [Pa] after an update."""
        return np.array([chamber_pressure(self._volume(positions), self.reals)])

    def _limit(self, volume: float) -> float:
        """Return the volume [m^3] beyond which the chamber counts as unstable in a solve from ``volume`` [m^3]."""
        return self.LARGEST_INFLATION * max(abs(volume), self._rest_volume, self.actuator.least)

    def ran_away(self, positions: Array, since: Array) -> bool:
        """Return whether a chamber of given pressure inflated beyond `RUNNING_AWAY` from ``since`` to ``positions``."""
        return self.unbounded and not self._volume(positions) <= self.RUNNING_AWAY * self._limit(self._volume(since))

    def state(self, positions: Array) -> ActuatorState:
        """Return command, volume and pressure."""
        extent = self._volume(positions)
        return ActuatorState(self.actuator.mode, self._command, extent, float(self.reals[EFFORT]))

    def potential(self, positions: Array, command: float) -> tuple[float, float]:
        """Return the potential [J] and its derivative by the command: for a commanded volume, the pressure."""
        if self.updates:
            return 0.0, float(self.reals[EFFORT])
        slope = self._rest_volume - self._volume(positions)
        return command * slope, slope
