# SPDX-License-Identifier: Apache-2.0
"""Cables as terms.

The segments have the lengths d. The cable's length is L = sum sqrt(d^2 + e^2) - c, with the constant c for which L is
exact in the undeformed body. Without the short length e, L would have a kink at d = 0, where a cable holds two points
together.

A cable of length L has the tension t = max(0, T + k (L - l)) and the energy (t^2 - T^2) / (2 k). This is the augmented
Lagrangian of the constraint L <= l with multiplier T. For T = 0 it is an elastic cable of stiffness k. For k = 0 the
tension is T and the energy T (L - l).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import ActuatorState, Cable, Mode
from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.materials.table import YOUNG
from gdfe_ros.materials.tensor import scale_vector
from gdfe_ros.mesh.triples import dot, minus, plus
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved
from gdfe_ros.solver.terms.multiplier import EFFORT, STIFFNESS, TARGET, EffortTerm
from gdfe_ros.solver.terms.term import as_arrays, share, spread, term_kernel, weighted
from gdfe_ros.solver.vectors import NEGLIGIBLE, Array

EYELET, EXCESS, CARRIERS, WEIGHTS = range(STIFFNESS + 1, STIFFNESS + 5)
"""Offsets in ``reals``, after T [N], l [m] and k [N/m], of e [m], c [m], the number of vertices that carry each point,
and the weights of these vertices; the places of points in the world [m] follow them.
"""


@inlined
def point(x, reals, integers, i):
    """Return the position [m] of cable point ``i``."""
    count, anchor = int(reals[CARRIERS]), WEIGHTS + len(integers) + 3 * i
    place = reals[anchor], reals[anchor + 1], reals[anchor + 2]
    return plus(place, weighted(x, integers, count * i, reals, WEIGHTS + count * i, count))


@inlined
def segment(x, reals, integers, i):
    """Return the vector (3,) [m] from cable point ``i`` to the next one, and the length sqrt(d^2 + e^2) [m]."""
    d = minus(point(x, reals, integers, i + 1), point(x, reals, integers, i))
    return d, np.sqrt(dot(d, d) + reals[EYELET] * reals[EYELET])


@kernel
def cable_length(x, reals, integers):
    """Return the length [m] of a cable at positions ``x`` (n, 3) [m]."""
    total = -reals[EXCESS]
    for i in range(len(integers) // int(reals[CARRIERS]) - 1):
        total += segment(x, reals, integers, i)[1]
    return total


@kernel
def cable_tension(length, reals):
    """Return the tension [N] of a cable of the given ``length`` [m]."""
    return max(0.0, reals[EFFORT] + reals[STIFFNESS] * (length - reals[TARGET]))


@kernel
def pull(x, reals, integers, tension, force):
    """Add ``tension`` times dL/dx to ``force`` (n, 3)."""
    count = int(reals[CARRIERS])
    for i in range(len(integers) // count - 1):
        d, length = segment(x, reals, integers, i)
        along = scale_vector(d, tension / length if length > 0.0 else 0.0)
        share(force, integers, count * i, reals, WEIGHTS + count * i, count, scale_vector(along, -1.0))
        share(force, integers, count * (i + 1), reals, WEIGHTS + count * (i + 1), count, along)


@kernel
def cable_energy(x, reals, integers, force, size):
    """Return the energy [J] of a cable and add its gradient; `term_kernel` needs this signature."""
    length = cable_length(x, reals, integers)
    effort, stiffness = reals[EFFORT], reals[STIFFNESS]
    tension = cable_tension(length, reals)
    if stiffness > 0.0:
        energy = (tension * tension - effort * effort) / (2.0 * stiffness)
    else:
        energy = effort * (length - reals[TARGET])
    size[0] += tension * length
    if tension > 0.0:
        pull(x, reals, integers, tension, force)
    return energy


@term_kernel
def _entry(x, n, reals, k, integers, i, force, size):
    return cable_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class CableTerm(EffortTerm):
    """A cable with a commanded tension, length or shortening.

    Args:
        cable: cable of the scene.
        body: the body through which the cable passes.

    Attributes:
        actuator: the cable.
    """

    ROUND = 3e-4
    """The length e, divided by the mean length of a cable's undeformed segments. With e = 0, the line search would
    shorten every Newton step to the kink.
    """
    FAINT, NEARLY = 1e-12, 3e-6
    """FAINT: negligible tension, divided by Young's modulus times the squared body size. NEARLY: negligible
    lengthening, divided by the body's size. In finite differences, a cable that is about to become taut gets a tension
    from both amounts, so that it counts as taut.
    """

    kernel, exact = _entry, True

    def __init__(self, cable: Cable, body: Body) -> None:
        self.actuator, self._elastic = cable, math.isfinite(cable.stiffness)
        self._carriers = cable.points.corners.shape[1]
        self._anchors = np.zeros((len(cable.points.corners), 3))
        if cable.points.anchors is not None:
            self._anchors[:] = cable.points.anchors
        numbers = np.concatenate([np.zeros(WEIGHTS), cable.points.weights.ravel(), self._anchors.ravel()])
        numbers[CARRIERS] = self._carriers
        super().__init__(cable.name, numbers, cable.points.corners.ravel().astype(np.int32))
        self._rest_length = float(cable_length(body.rest, self.reals, self.integers))
        self.reals[EYELET] = self.ROUND * self._rest_length / max(1, len(cable.points.corners) - 1)
        self.reals[EXCESS] = cable_length(body.rest, self.reals, self.integers) - self._rest_length
        self._body, self._command, self._lifted = body, cable.neutral(body.rest), 0.0
        stiff = [handle.vertices for handle in body.handles if not handle.loose]
        held = np.isin(cable.points.corners, np.concatenate([np.zeros(0, np.int32), *stiff]))
        self._anchored = (held | (np.abs(cable.points.weights) < NEGLIGIBLE)).all(axis=1)

    @property
    def updates(self) -> bool:
        """Whether a multiplier keeps the length."""
        return self.actuator.constrains

    def fit(self, matrix: ConstantMatrix) -> None:
        """Set the stiffness of an elastic cable; for a commanded length, set a penalty by the body's stiffness."""
        if self.actuator.mode is Mode.TENSION:
            return
        if self._elastic:
            self.reals[STIFFNESS] = self.actuator.stiffness
            return
        force, unknowns = self._pull(slice(None)), self._body.unknowns
        moving = np.concatenate([unknowns.free, unknowns.members])
        if np.abs(force[moving]).max(initial=0.0) <= NEGLIGIBLE:
            # The segments of a cable that is straight between handles balance each other: use the most compliant one.
            stretches = [self._pull(slice(first, first + 2)) for first in range(len(self._anchored) - 1)]
            force = max(stretches, key=matrix.compliance)
        self.fit_penalty(matrix, force)

    def _pull(self, points: slice) -> Array:
        """Return dL/dx (n, 3) of the undeformed segments between ``points``."""
        weights, corners = (values[points] for values in self._points())
        force, anchors = np.zeros_like(self._body.rest), self._anchors[points]
        reals = np.concatenate([self.reals[:WEIGHTS], weights.ravel(), anchors.ravel()])
        pull(self._body.rest, reals, corners.ravel(), 1.0, force)
        return force

    def _points(self) -> tuple[Array, NDArray[np.int32]]:
        """Return the weights (p, c) and vertices (p, c) that carry the cable points."""
        corners = self.integers.reshape(-1, self._carriers)
        return self.reals[WEIGHTS : WEIGHTS + corners.size].reshape(corners.shape), corners

    def couplings(self) -> NDArray[np.int32]:
        """Return the vertices that carry the two ends of each segment (k, 2 c)."""
        _, corners = self._points()
        return np.concatenate([corners[:-1], corners[1:]], axis=1)

    def tangents(self, positions: Array) -> Array:
        """Return the tangents of the segments (k, 6 c, 6 c) [N/m], by which a taut cable resists bending.

        They are t / l (I - d d^T), with the tension t, the segment's length l and its direction d, distributed to the
        vertices that carry both ends.
        """
        weights, corners = self._points()
        points = np.einsum("ia,iak->ik", weights, positions[corners]) + self._anchors
        stretch = np.diff(points, axis=0)
        length = np.sqrt(np.square(stretch).sum(axis=1) + self.reals[EYELET] ** 2)
        along = stretch / np.where(length > 0.0, length, 1.0)[:, None]
        tension = cable_tension(cable_length(positions, self.reals, self.integers), self.reals)
        bent = np.eye(3) - along[:, :, None] * along[:, None, :]
        bent *= (tension / np.where(length > 0.0, length, np.inf))[:, None, None]
        signed = np.concatenate([-weights[:-1], weights[1:]], axis=1)
        return spread(signed, bent)

    def has_spring(self, positions: Array) -> bool:
        """Return whether the cable is taut, and has a stiffness or a penalty."""
        numbers = self.reals
        return bool(numbers[STIFFNESS] and cable_tension(cable_length(positions, numbers, self.integers), numbers))

    def spring(self, positions: Array) -> Array:
        """Return the cable as a spring (n, 3), sqrt(k) dL/dx, with its stiffness or penalty k."""
        slope = np.zeros_like(positions)
        pull(positions, self.reals, self.integers, np.sqrt(self.reals[STIFFNESS]), slope)
        return slope

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: Array, ratio: float) -> None:
        """Set the command; for a commanded length, also the initial tension, extrapolated from the last steps."""
        self._command, numbers = commands[self.name], self.reals
        if self.actuator.mode is Mode.TENSION:
            numbers[EFFORT], numbers[TARGET] = self._command, cable_length(positions, numbers, self.integers)
            return
        numbers[EFFORT] = 0.0 if self._elastic else max(0.0, self.guess_effort(saved, ratio))
        numbers[TARGET] = self.find_target_length(self._command)

    def resume(self, commands: Mapping[str, float], saved: Saved, found: Saved, positions: Array) -> None:
        """Restore the tension at the end of a solve; a cable at the limit of becoming taut counts as taut."""
        super().resume(commands, saved, found, positions)
        numbers, size = self.reals, self._body.size
        least = self.FAINT * float(self._body.table.parameters[:, YOUNG].min()) * size**2
        least += self.NEARLY * numbers[STIFFNESS] * size
        length = cable_length(positions, numbers, self.integers)
        taut = length >= (1.0 - NEGLIGIBLE) * numbers[TARGET]
        self._lifted = least if taut and cable_tension(length, numbers) < least else 0.0
        numbers[EFFORT] += self._lifted

    def vary(self, commands: Mapping[str, float], saved: Saved, positions: Array) -> None:
        """Set another command or stored state after `resume`, to differentiate by it."""
        self.begin(commands, saved, positions, 0.0)
        self.reals[EFFORT] += self._lifted

    def renew(self, positions: Array) -> Array:
        """Return the tension (1,) [N] after an update."""
        return np.array([cable_tension(cable_length(positions, self.reals, self.integers), self.reals)])

    def find_target_length(self, command: float) -> float:
        """Return the length [m] for a command that is a length or a shortening."""
        return command if self.actuator.mode is Mode.LENGTH else self._rest_length - command

    @property
    def strung(self) -> bool:
        """Whether the distance of two or more points on handles or in the world limits a commanded length."""
        return self.updates and int(self._anchored.sum()) > 1

    def shortest(self, base: Array) -> float:
        """Return the least length [m] with handles at ``base`` (n, 3) [m]: straight between the fixed points."""
        held = self.actuator.points.at(base)[self._anchored]
        return float(np.linalg.norm(np.diff(held, axis=0), axis=1).sum())

    def state(self, positions: Array) -> ActuatorState:
        """Return command, length and tension."""
        extent = float(cable_length(positions, self.reals, self.integers))
        effort = cable_tension(extent, self.reals) if self._elastic else self.reals[EFFORT]
        return ActuatorState(self.actuator.mode, self._command, extent, float(effort))

    def potential(self, positions: Array, command: float) -> tuple[float, float]:
        """Return the potential [J] and its derivative with respect to the command.

        For a commanded length the derivative is minus the tension, for a shortening it is the tension.
        """
        state = self.state(positions)
        stored = 0.5 * state.effort**2 / self.actuator.stiffness if self._elastic else 0.0
        if self.actuator.mode is Mode.TENSION:
            slope = state.extent - self._rest_length
            return state.effort * slope + stored, slope
        return stored, state.effort if self.actuator.mode is Mode.SHORTENING else -state.effort
