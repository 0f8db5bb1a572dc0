# SPDX-License-Identifier: Apache-2.0
"""Grips as terms: while a grip holds, its points keep their places on a handle, an obstacle or a rigid body.

A held point x_i keeps the place q_i = sum_a w_ia x_a + c_i. On a rigid body, the place is a weighted mean of the body's
four vertices x_a, and c_i = 0. On a handle or an obstacle, the weights are zero, and c_i moves with the commanded pose.
With the gaps d_i = x_i - q_i, the energy is sum_i l_i . d_i + s/2 |d_i|^2: the augmented Lagrangian of d_i = 0 with the
multipliers l_i [N] and the penalty s [N/m].

If the command rises from 0, the grip closes: it stores the places of the points at the beginning of the step. If the
command falls, the grip opens: the penalty is removed, and the last forces l_i fall in proportion to the command. At the
command 0 the forces are zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators.actuator import ActuatorState, Grip
from gdfe_ros.compiled import kernel
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved, State
from gdfe_ros.solver.terms.multiplier import UpdatedTerm
from gdfe_ros.solver.terms.term import as_arrays, spread, term_kernel, weighted
from gdfe_ros.solver.vectors import Array

ACTS, STIFFNESS, HEAD = range(3)
"""Offsets in ``reals`` of 1 for a grip with forces (0 without), of s [N/m], and of the rows of the points."""
WEIGHTS, PLACE, PULL, ROW = 0, 4, 7, 10
"""Offsets in a point's row of the weights w_a (4,), the place c (3,) [m] and the multiplier l (3,) [N]; row length."""
POINT = 5
"""Number of vertices per point: the held vertex, and the four vertices that carry its place."""


class Hold(IntEnum):
    """State of a grip: it holds nothing, it holds, or its forces fall to zero."""

    OFF, HOLDS, FADES = range(3)


@kernel
def grip_energy(x, reals, integers, force, size):
    """Return the energy [J] of a grip and add its gradient; `term_kernel` needs this signature."""
    energy, stiffness = 0.0, reals[STIFFNESS]
    if reals[ACTS] == 0.0:
        return energy
    for i in range(len(integers) // POINT):
        row, own, carriers = HEAD + ROW * i, integers[POINT * i], POINT * i + 1
        place = weighted(x, integers, carriers, reals, row + WEIGHTS, 4)
        for axis in range(3):
            gap = x[own, axis] - place[axis] - reals[row + PLACE + axis]
            held = reals[row + PULL + axis]
            pull = held + stiffness * gap
            energy += gap * (held + 0.5 * stiffness * gap)
            size[0] += abs(gap * pull)
            force[own, axis] += pull
            for a in range(4):
                force[integers[carriers + a], axis] -= reals[row + WEIGHTS + a] * pull
    return energy


@term_kernel
def _entry(x, n, reals, k, integers, i, force, size):
    return grip_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class GripTerm(UpdatedTerm):
    """A grip with its command: 0 or 1, or a value between them within a load path or a step in motion.

    Args:
        grip: grip of the scene.
        body: the body with the held vertices.

    Attributes:
        actuator: the grip.
    """

    STIFF = 1e3
    """Penalty s of a grip, divided by the largest stiffness of a held vertex. Each update divides the error of the
    forces by about this number. The penalty may be that large because kept tangents contain it.
    """
    FINE = 1e-3
    """Allowed displacement by the last change of the forces, divided by the tolerance. It is small because, in motion,
    a displacement as large as the tolerance in one internal step belongs to a force of the order of the weight.
    """

    kernel, exact, stored = _entry, True, "pull"

    def __init__(self, grip: Grip, body: Body) -> None:
        handles = {handle.name: handle for handle in body.handles}
        self.actuator, self._body, self.size = grip, body, body.size
        self._holder, held = handles[grip.holder], handles.get(grip.held)
        self._points = grip.vertices if held is None else held.vertices
        carriers = np.repeat(self._points[:, None], 4, axis=1)
        if self._carried:
            carriers[:] = self._holder.vertices
        vertices = np.concatenate([self._points[:, None], carriers], axis=1).ravel().astype(np.int32)
        super().__init__(grip.name, np.zeros(HEAD + ROW * len(self._points)), vertices)
        self._hold, self._command, self._penalty = Hold.OFF, 0.0, 0.0
        self._poses, self._last = {grip.holder: Pose()}, None
        self._kept, self._updated, self.errors = self.neutral(), None, []
        self._fading: Array | None = None

    @property
    def _carried(self) -> bool:
        """Whether the holder is a rigid body, whose four vertices carry the places."""
        return isinstance(self._holder, RigidBody)

    @property
    def _rows(self) -> Array:
        """The rows of the points (k, 10), a view."""
        return self.reals[HEAD:].reshape(-1, ROW)

    @property
    def own_multipliers(self) -> Array:
        """The multipliers l (k, 3) [N], a view."""
        return self._rows[:, PULL:]

    @property
    def updates(self) -> bool:
        """Whether the grip holds, so that multipliers are updated."""
        return self._hold is Hold.HOLDS

    @property
    def pairs(self) -> list[tuple[str, NDArray[np.int32]]]:
        """Names of the holder and, if that is a rigid body, of the held body, each with the vertices fixed to it.

        The list is empty if nothing is held.
        """
        if not self.updates:
            return []
        found = [(self.actuator.holder, self._points)]
        return [*found, (self.actuator.held, self._holder.vertices)] if self._carried else found

    @property
    def stage(self) -> int:
        """1 while the penalty acts, else 0."""
        return int(self.updates)

    def fit(self, matrix: ConstantMatrix) -> None:
        """Set the penalty in proportion to the largest stiffness of a held vertex."""
        self._penalty = self.STIFF * float(matrix.assembled.diagonal()[self._points].max())

    def couplings(self) -> NDArray[np.int32]:
        """Return each held vertex, with the four vertices of a rigid body that holds it: (k, 1) or (k, 5)."""
        vertices = self.integers.reshape(-1, POINT)
        return vertices if self._carried else vertices[:, :1]

    def tangents(self, positions: Array) -> Array:
        """Return the constant tangents s [1, -w]^T [1, -w] of the points (k, 3 c, 3 c) [N/m]."""
        signed = np.ones((len(self._points), self.couplings().shape[1]))
        signed[:, 1:] = -self._rows[:, WEIGHTS:PLACE][:, : signed.shape[1] - 1]
        return spread(signed, self.reals[STIFFNESS] * np.tile(np.eye(3), (len(signed), 1, 1)))

    def neutral(self) -> Saved:
        """Return the stored state of a grip that holds nothing."""
        none = np.zeros((len(self._points), 3))
        start = {"hold": np.zeros(1), "command": np.zeros(1), "weights": np.zeros((len(none), 4))}
        return {**start, "places": none, "pull": none, "before": none}

    def set_targets(self, poses: Mapping[str, Pose], last: State) -> None:
        """Store the commanded poses, and the state whose positions a closing grip keeps."""
        self._poses, self._last = poses, last

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: Array, ratio: float) -> None:
        """Close, keep or open the grip, according to the change of the command since the state ``saved``."""
        before, self._command = float(saved["command"][0]), commands[self.name]
        self._hold, kept, self._fading = Hold(int(saved["hold"][0])), dict(saved), None
        if self._command > before and self._hold is not Hold.HOLDS:
            self._hold = Hold.HOLDS
            kept.update(self.neutral(), **self._take_points(self._last))
        elif self._command < before and self._hold is not Hold.OFF:
            self._hold = Hold.FADES if self._command > 0.0 else Hold.OFF
            self._fading = saved["pull"] / before
            kept["pull"] = self._fading * self._command
        pull, seen = kept["pull"], kept
        if self._hold is Hold.HOLDS:
            pull = pull + ratio * (pull - kept["before"])
        elif self._hold is Hold.OFF:
            kept = self.neutral()
            pull = kept["pull"]
        self._kept, self._updated, self.errors, rows = kept, None, [], self._rows
        self.reals[ACTS] = self._hold is not Hold.OFF
        self.reals[STIFFNESS] = self._penalty if self._hold is Hold.HOLDS else 0.0
        rows[:, WEIGHTS:PLACE], rows[:, PULL:] = seen["weights"], pull
        rows[:, PLACE:PULL] = self._places(seen["places"])

    def vary(self, commands: Mapping[str, float], saved: Saved, positions: Array) -> None:
        """Set other poses or another stored state after `resume`; the command stays, because 0 and 1 cannot vary."""
        self.begin({**commands, self.name: self._command}, saved, positions, 0.0)

    def _take_points(self, last: State) -> Saved:
        """Return the weights or places that fix the points to the holder where they are in the state ``last``."""
        points = last.positions[self._points]
        if self._carried:
            origin, axes = self._holder.find_frame(last.positions)
            return {"weights": 0.25 + ((points - origin) @ axes) @ self._holder.signs.T}
        pose, centre = last.poses[self._holder.name], self._holder.centre(self._body.rest)
        back = Rotation.from_rotvec(pose.rotation).inv().apply(points - centre - pose.translation)
        return {"places": back + centre}

    def _places(self, places: Array) -> Array:
        """Return the places c (k, 3) [m] at the holder's present pose, from ``places`` (k, 3) [m] at its rest pose."""
        if self._carried:
            return np.zeros_like(places)
        return self._poses[self._holder.name].apply(places, self._holder.centre(self._body.rest))

    def _gaps(self, positions: Array) -> Array:
        """Return the gaps d (k, 3) [m] of the points from their places."""
        vertices, rows = self.integers.reshape(-1, POINT), self._rows
        carried = np.einsum("ka,kai->ki", rows[:, WEIGHTS:PLACE], positions[vertices[:, 1:]])
        return positions[vertices[:, 0]] - carried - rows[:, PLACE:PULL]

    def renew(self, positions: Array) -> Array:
        """Return l + s d (k, 3) [N]: minus the forces on the points."""
        pull = self.own_multipliers.copy()
        return pull + self.reals[STIFFNESS] * self._gaps(positions) if self.updates else pull

    def _acting(self, positions: Array) -> Array:
        """Return minus the forces (k, 3) [N] on the points in the last minimisation, which ended at ``positions``."""
        done = self._updated is not None and np.array_equal(self._updated, positions[self._points])
        return self.own_multipliers.copy() if done else self.renew(positions)

    def update(self, positions: Array) -> float:
        """Update the forces that keep the points in their places; return their change as a displacement [m]."""
        self.own_multipliers[...] = self.renew(positions)
        self._updated = positions[self._points]
        self.errors.append(self.STIFF / self.FINE * float(np.linalg.norm(self._gaps(positions), axis=1).max()))
        return self.errors[-1]

    def finish(self, saved: Saved, positions: Array) -> Saved:
        """Return the state to store: command, places and forces."""
        found = {"hold": np.array([float(self._hold)]), "command": np.array([self._command])}
        forces = {"pull": self._acting(positions), "before": saved["pull"]}
        return {"weights": self._kept["weights"], "places": self._kept["places"], **found, **forces}

    @property
    def per_metre(self) -> Array:
        """The penalty [N/m] of each force (3 k,); empty if nothing is held."""
        return np.full(self.multipliers.shape, self.reals[STIFFNESS])

    def potential(self, positions: Array, command: float) -> tuple[float, float]:
        """Return the potential [J] of an opening grip's forces, and its derivative by the command; else zeros."""
        if self._fading is None:
            return 0.0, 0.0
        slope = float(np.vdot(self._fading, self._gaps(positions)))
        return slope * command, slope

    def state(self, positions: Array) -> ActuatorState:
        """Return the command, the extent (1 if the grip holds, else 0), and the magnitude [N] of the total force."""
        force = float(np.linalg.norm(self._acting(positions).sum(axis=0)))
        return ActuatorState(self.actuator.mode, self._command, float(self.updates), force)

    @property
    def presses(self) -> bool:
        """Whether the grip has a reaction on a handle or an obstacle; on a rigid body, forces act on its vertices."""
        return bool(self.reals[ACTS]) and not self._carried

    def wrench(self, positions: Array) -> Array:
        """Return force [N] and moment [N m] (6,) by which a handle or an obstacle acts on the points.

        The moment is about the mean of a handle's vertices, or about an obstacle's origin.
        """
        if isinstance(self._holder, Obstacle):
            centre = self._holder.frame(self._poses[self._holder.name])[0]
        else:
            centre = positions[self._holder.vertices].mean(axis=0)
        forces = -self._acting(positions)
        moments = np.cross(positions[self._points] - centre, forces)
        return np.concatenate([forces.sum(axis=0), moments.sum(axis=0)])

    def holds(self, saved: Saved) -> bool:
        """Return whether the grip holds something, or its forces still fall, in the stored state."""
        return bool(saved["hold"][0])
