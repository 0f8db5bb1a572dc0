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
from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.mesh.tetrahedra import face_slopes, face_weights, triangle_rule
from gdfe_ros.mesh.triples import cross, dot
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved
from gdfe_ros.solver.tangent.springs import Springs
from gdfe_ros.solver.terms.multiplier import fitted_penalty, followed, remembered
from gdfe_ros.solver.terms.term import Term, as_arrays, term_kernel
from gdfe_ros.solver.terms.volume_curvature import PRODUCTS, volume_curvature

EFFORT, TARGET, STIFFNESS, LIMIT = range(4)
"""Offsets in ``reals`` of p [Pa], v [m^3], k [Pa/m^3] and the volume [m^3] above which the chamber counts as unstable.
"""
LARGEST_INFLATION = 8.0
"""A chamber of given pressure counts as unstable if its volume grows by more than this factor in one solve."""
RUNNING_AWAY = 3.0 / 16.0
"""A chamber counts as unstable in a failed solve that ends above this fraction of the volume limit."""
_PLACES, FACE_SHARES = triangle_rule(3)
FACE_SHAPES, FACE_SLOPES = face_weights(_PLACES), face_slopes(_PLACES)
"""Shape functions (9, 6) and their derivatives (9, 6, 2) at the integration points of a six-node face. With the
weights `FACE_SHARES`, these points integrate the volume exactly: its integrand has degree 4.
"""


@inlined
def corners_of(x, integers, q):
    """Return the corners of quad ``q`` relative to the chamber's first vertex, which keeps rounding small."""
    o, i = integers[0], 4 * q
    a, b, c, d = integers[i], integers[i + 1], integers[i + 2], integers[i + 3]
    return (
        (x[a, 0] - x[o, 0], x[a, 1] - x[o, 1], x[a, 2] - x[o, 2]),
        (x[b, 0] - x[o, 0], x[b, 1] - x[o, 1], x[b, 2] - x[o, 2]),
        (x[c, 0] - x[o, 0], x[c, 1] - x[o, 1], x[c, 2] - x[o, 2]),
        (x[d, 0] - x[o, 0], x[d, 1] - x[o, 1], x[d, 2] - x[o, 2]),
    )


@kernel
def chamber_volume(x, integers):
    """Return the exact volume [m^3] inside bilinear quads: the mean over both divisions of each quad into triangles."""
    total = 0.0
    for q in range(len(integers) // 4):
        a, b, c, d = corners_of(x, integers, q)
        bc, cd, bd = cross(b, c), cross(c, d), cross(b, d)
        total += a[0] * (bc[0] + cd[0] + bd[0]) + a[1] * (bc[1] + cd[1] + bd[1]) + a[2] * (bc[2] + cd[2] + bd[2])
        total += b[0] * cd[0] + b[1] * cd[1] + b[2] * cd[2]
    return total / 12.0


@kernel
def chamber_pressure(volume, reals):
    """Return the pressure [Pa] of a chamber of the given ``volume`` [m^3]."""
    return reals[EFFORT] - reals[STIFFNESS] * (volume - reals[TARGET])


@kernel
def push(x, integers, pressure, force):
    """Subtract ``pressure`` times dV/dx from ``force`` (n, 3)."""
    scale = pressure / 12.0
    for q in range(len(integers) // 4):
        a, b, c, d = corners_of(x, integers, q)
        ab, ac, ad = cross(a, b), cross(a, c), cross(a, d)
        bc, bd, cd = cross(b, c), cross(b, d), cross(c, d)
        for i in range(3):
            force[integers[4 * q], i] -= scale * (bc[i] + cd[i] + bd[i])
            force[integers[4 * q + 1], i] -= scale * (cd[i] - ac[i] - ad[i])
            force[integers[4 * q + 2], i] -= scale * (ab[i] - ad[i] - bd[i])
            force[integers[4 * q + 3], i] -= scale * (ac[i] + ab[i] + bc[i])


@kernel
def chamber_energy(x, reals, integers, force, size):
    """Return the energy [J] of a chamber, infinite beyond its limit, and add its gradient.

    `term_kernel` needs this signature.
    """
    volume = chamber_volume(x, integers)
    change, stiffness = volume - reals[TARGET], reals[STIFFNESS]
    if not abs(volume) <= reals[LIMIT]:
        return np.inf
    pressure = chamber_pressure(volume, reals)
    size[0] += abs(pressure * volume)
    if pressure != 0.0:
        push(x, integers, pressure, force)
    return change * (0.5 * stiffness * change - reals[EFFORT])


@kernel
def face_volume(x, integers):
    """Return the volume [m^3] enclosed by six-node faces: 1/6 int x . (dx/dxi x dx/deta), exact."""
    total, o = 0.0, integers[0]
    for q in range(len(integers) // 6):
        for p in range(len(FACE_SHARES)):
            at, first, second = face_point(x, integers, o, q, p)
            total += FACE_SHARES[p] * dot(at, cross(first, second))
    return total / 6.0


@inlined
def face_point(x, integers, o, q, p):
    """Return position relative to vertex ``o``, dx/dxi and dx/deta [m] at a six-node face's integration point."""
    p0, p1, p2, a0, a1, a2, b0, b1, b2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(6):
        v, n = integers[6 * q + a], FACE_SHAPES[p, a]
        g, h = FACE_SLOPES[p, a, 0], FACE_SLOPES[p, a, 1]
        d0, d1, d2 = x[v, 0] - x[o, 0], x[v, 1] - x[o, 1], x[v, 2] - x[o, 2]
        p0, p1, p2 = p0 + n * d0, p1 + n * d1, p2 + n * d2
        a0, a1, a2 = a0 + g * d0, a1 + g * d1, a2 + g * d2
        b0, b1, b2 = b0 + h * d0, b1 + h * d1, b2 + h * d2
    return (p0, p1, p2), (a0, a1, a2), (b0, b1, b2)


@kernel
def push_faces(x, integers, pressure, force):
    """Subtract pressure times the derivative dV/dx of `face_volume` from ``force`` (n, 3).

    On a closed surface dV/dx is the integral of the shape functions times the normal.
    """
    o = integers[0]
    for q in range(len(integers) // 6):
        for p in range(len(FACE_SHARES)):
            at, first, second = face_point(x, integers, o, q, p)
            across, over, under = cross(first, second), cross(second, at), cross(at, first)
            scale = pressure * FACE_SHARES[p] / 6.0
            for a in range(6):
                n, g, h = FACE_SHAPES[p, a], FACE_SLOPES[p, a, 0], FACE_SLOPES[p, a, 1]
                for i in range(3):
                    force[integers[6 * q + a], i] -= scale * (n * across[i] + g * over[i] + h * under[i])


@kernel
def face_chamber_energy(x, reals, integers, force, size):
    """Return the energy [J] of a chamber of six-node faces as `chamber_energy` does, and add its gradient."""
    volume = face_volume(x, integers)
    change, stiffness = volume - reals[TARGET], reals[STIFFNESS]
    if not abs(volume) <= reals[LIMIT]:
        return np.inf
    pressure = chamber_pressure(volume, reals)
    size[0] += abs(pressure * volume)
    if pressure != 0.0:
        push_faces(x, integers, pressure, force)
    return change * (0.5 * stiffness * change - reals[EFFORT])


@kernel
def carried_energy(x, reals, integers, force, size):
    """Return the energy [J] of a chamber whose corners are points carried by eight vertices each; add its gradient.

    ``reals`` has the vertices' weights after the chamber's own numbers. ``integers`` has the number of points, the
    eight vertices of each point, and the quads between the points.
    """
    count = integers[0]
    points, pulls = np.zeros((count, 3)), np.zeros((count, 3))
    for p in range(count):
        for a in range(8):
            vertex, weight = integers[1 + 8 * p + a], reals[LIMIT + 1 + 8 * p + a]
            for i in range(3):
                points[p, i] += weight * x[vertex, i]
    energy = chamber_energy(points, reals, integers[1 + 8 * count :], pulls, size)
    for p in range(count):
        for a in range(8):
            vertex, weight = integers[1 + 8 * p + a], reals[LIMIT + 1 + 8 * p + a]
            for i in range(3):
                force[vertex, i] += weight * pulls[p, i]
    return energy


@term_kernel
def _carried_entry(x, n, reals, k, integers, i, force, size):
    return carried_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@term_kernel
def _face_entry(x, n, reals, k, integers, i, force, size):
    return face_chamber_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@term_kernel
def _entry(x, n, reals, k, integers, i, force, size):
    return chamber_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class ChamberTerm(Term):
    """A chamber with a commanded pressure or volume.

    Args:
        chamber: chamber of the scene.
        body: the body around the chamber.

    Attributes:
        actuator: the chamber.
        neutral_command: the command without effect on the undeformed body, in the unit of its mode.
        updates: whether a multiplier keeps the volume.
    """

    kernel = _entry

    def __init__(self, chamber: Chamber, body: Body) -> None:
        self.actuator, self._body = chamber, body
        reals, integers = np.array([0.0, 0.0, 0.0, math.inf]), chamber.quads.ravel().astype(np.int32)
        self._quads, self._six = integers, chamber.quads.shape[1] == 6
        if self._six:
            self.kernel = _face_entry
        self.exact = chamber.points is None
        if (points := chamber.points) is not None:
            self.kernel = _carried_entry
            reals = np.concatenate([reals, points.weights.ravel()])
            integers = np.concatenate([[len(points.corners)], points.corners.ravel(), integers], dtype=np.int32)
        super().__init__(chamber.name, reals, integers)
        self._around = np.unique(self._quads if points is None else points.corners)[None].astype(np.int32)
        self._faces = chamber.quads.astype(np.int32) if self.exact else np.zeros((0, 1), np.int32)
        self._rest_volume = self._volume(body.rest)
        self.updates = chamber.constrains
        self.neutral_command = self._rest_volume if self.updates else 0.0
        self._command = self.neutral_command

    def fit(self, matrix: ConstantMatrix) -> None:
        """For a commanded volume, set a penalty in proportion to the body's initial stiffness."""
        if self.updates:
            self.reals[STIFFNESS] = fitted_penalty(matrix, self._pressed(self._body.rest), self.name)

    def _pressed(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return -dV/dx (n, 3) [m^2]."""
        places, points = self.actuator.at(positions), self.actuator.points
        force = np.zeros_like(places)
        (push_faces if self._six else push)(places, self._quads, 1.0, force)
        if points is not None:
            pulls, force = points.weights[..., None] * force[:, None], np.zeros_like(positions)
            np.add.at(force, points.corners, pulls)
        return force

    def couplings(self) -> NDArray[np.int32]:
        """Return the corners of the faces (k, c); none if other vertices carry them."""
        return self._faces

    def tangents(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the tangents -p d2V/dx2 [N/m] of the faces, (k, 3 c, 3 c)."""
        count, corners = self._faces.shape
        found = np.zeros((count, 3 * corners, 3 * corners))
        pressure = chamber_pressure(self._volume(positions), self.reals)
        if pressure and count:
            volume_curvature(positions, self._faces, PRODUCTS[corners], -pressure, found)
        return found

    def springs(self, positions: NDArray[np.float64]) -> Springs:
        """Return a commanded volume with its penalty k as a spring: k dV/dx dV/dx^T."""
        if not self.updates:
            return Springs.none()
        return Springs.between(self._around, np.sqrt(self.reals[STIFFNESS]) * self._pressed(positions)[self._around])

    def _volume(self, positions: NDArray[np.float64]) -> float:
        volume = face_volume if self._six else chamber_volume
        return float(volume(self.actuator.at(positions), self._quads))

    def neutral(self) -> Saved:
        """Return the stored state without pressure."""
        return remembered(0.0, {})

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64], ratio: float) -> None:
        """Set the command; for a commanded volume, also the initial pressure, extrapolated from the last steps."""
        self._command, numbers = commands[self.name], self.reals
        if self.updates:
            numbers[EFFORT], numbers[TARGET], numbers[LIMIT] = followed(saved, ratio), self._command, math.inf
            return
        volume = self._volume(positions)
        numbers[EFFORT], numbers[TARGET] = self._command, volume
        numbers[LIMIT] = self._limit(volume)

    def update(self, positions: NDArray[np.float64]) -> float:
        """Update the pressure that keeps the volume; return the error of the volume as a length [m]."""
        volume = self._volume(positions)
        self.reals[EFFORT] = chamber_pressure(volume, self.reals)
        return abs(volume - self.reals[TARGET]) / max(abs(self.reals[TARGET]), self.actuator.least, 1e-30) ** (
            2.0 / 3.0
        )

    def finish(self, saved: Saved, positions: NDArray[np.float64]) -> Saved:
        """Return the state to store: the pressure."""
        return remembered(float(self.reals[EFFORT]), saved)

    def resume(self, commands: Mapping[str, float], saved: Saved, found: Saved, positions: NDArray[np.float64]) -> None:
        """Restore the pressure at the end of a solve."""
        self.begin(commands, saved, positions, 0.0)
        if self.updates:
            self.reals[EFFORT] = found["effort"][0]

    @property
    def multipliers(self) -> NDArray[np.float64]:
        """The pressure [Pa] that keeps the volume (1,); empty without such a constraint."""
        return self.reals[EFFORT : EFFORT + 1].copy() if self.updates else np.zeros(0)

    @property
    def per_metre(self) -> NDArray[np.float64]:
        """The penalty [Pa/m^3] times a surface of the chamber's size [m^2] (1,); empty without a constraint."""
        if not self.updates:
            return np.zeros(0)
        return self.reals[STIFFNESS : STIFFNESS + 1] * max(abs(self._rest_volume), self.actuator.least) ** (2.0 / 3.0)

    def hold(self, multipliers: NDArray[np.float64]) -> None:
        """Set the pressure [Pa] that keeps the volume."""
        if self.updates:
            self.reals[EFFORT] = multipliers[0]

    def updated(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pressure (1,) [Pa] after an update."""
        return np.array([chamber_pressure(self._volume(positions), self.reals)]) if self.updates else np.zeros(0)

    def _limit(self, volume: float) -> float:
        """Return the volume [m^3] beyond which the chamber counts as unstable in a solve from ``volume`` [m^3]."""
        return LARGEST_INFLATION * max(abs(volume), self._rest_volume, self.actuator.least)

    def ran_away(self, positions: NDArray[np.float64], since: NDArray[np.float64]) -> bool:
        """Return whether a chamber of given pressure inflated beyond `RUNNING_AWAY` from ``since`` to ``positions``."""
        pressed = math.isfinite(self.reals[LIMIT])
        return pressed and not self._volume(positions) <= RUNNING_AWAY * self._limit(self._volume(since))

    def state(self, positions: NDArray[np.float64]) -> ActuatorState:
        """Return command, volume and pressure."""
        extent = self._volume(positions)
        return ActuatorState(self.actuator.mode, self._command, extent, float(self.reals[EFFORT]))

    def potential(self, positions: NDArray[np.float64], command: float) -> tuple[float, float]:
        """Return the potential [J] and its derivative with respect to the command; for a volume it is the pressure."""
        if self.updates:
            return 0.0, float(self.reals[EFFORT])
        slope = self._rest_volume - self._volume(positions)
        return command * slope, slope
