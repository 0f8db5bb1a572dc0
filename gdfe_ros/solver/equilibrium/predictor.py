# SPDX-License-Identifier: Apache-2.0
"""Prediction of a step's end: extrapolation of a smooth motion, and extension of the handles' remaining motion.

The harmonic extension of displacements moves vertices along chords. Between two handles, a large rotation then folds
elements, and on fine meshes unfolding takes hundreds of iterations. Handles that turn are therefore extended as screws.
A screw is a rotation about an axis in space and a translation along this axis. With the rotation vector w and the
velocity v, it moves a point along the solution of dx/ds = w x x + v from s = 0 to 1. The (w, v) of a vertex is the
harmonic extension of the (w, v) of the handles. If all handles have one screw, the body moves rigidly.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.barrier import THRESHOLD
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.handle_motions import LEAST_TURN, HandleMotions
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.matrix.rotation import apply_left_jacobian
from gdfe_ros.solver.state import Motion, State
from gdfe_ros.solver.vectors import Array

HALF_TURN = np.radians(178.0)
"""Beyond this angle [rad], tiny differences decide the sense of a rotation."""


class Prediction(NamedTuple):
    """Start of a solve.

    Attributes:
        state: the state before the step, with predicted positions of vertices and handles.
        ratio: multiple of the last step's motion by which the state was extrapolated.
    """

    state: State
    ratio: float


class Predictor:
    """Predicts the end of a step from a state and its last motion.

    Args:
        body: the discretised body.
        handles: the kinematics of its handles.
        matrix: the constant matrix, which spreads motions of handles over the body.
    """

    LARGEST_RATIO = 2.0
    """Largest multiple of the last step's motion that is added."""
    SMOOTH = 0.5
    """The last motion is extrapolated if the present motion differs from a multiple of it by at most this fraction."""
    STILL = 1e-12
    """Handle displacements up to this multiple of the body's size count as rounding, and are not extended to free
    vertices.
    """
    FAR = 1e-2
    """Displacements below this multiple of the body's size, and turns of handles below it [rad], fold no element."""

    def __init__(self, body: Body, handles: HandleMotions, matrix: ConstantMatrix) -> None:
        self._free, self._matrix = body.unknowns.free, matrix
        self._held, self._handles, self._size = body.unknowns.prescribed, handles, body.size
        self._shape = body.shape
        # Weights of the handles are the same along all axes, unless rollers hold vertices along some of them.
        counts = [len(handle.vertices) for handle in body.handles if handle.slide is None]
        ends = [] if len(body.unknowns.fixed) else itertools.accumulate(counts, initial=0)
        self._parts = [slice(a, b) for a, b in itertools.pairwise(ends) if b > a]
        self._turning = handles.turning_vertices()

    def predict(self, state: State, base: Array, change: Array) -> Prediction:
        """Return the start of a solve that moves the handles from ``state`` to ``base`` (n, 3) [m].

        ``change`` (c,) are the changes of the commands of actuators and loads. If extrapolation would fold elements,
        the last motion is not extrapolated.
        """
        motion = base[self._held] - state.base[self._held]
        ratio = _ratio(state.motion, motion, change)
        found = self._extrapolate(state, base, ratio)
        far = ratio != 0.0 and ratio * float(np.abs(state.motion.move).max()) > self.FAR * self._size
        if far and least_volume_ratio(found.state.positions, self._shape) < THRESHOLD:
            return self._extrapolate(state, base, 0.0)
        return found

    def _extrapolate(self, state: State, base: Array, ratio: float) -> Prediction:
        """Return ``state`` with handles at ``base`` (n, 3) [m], displaced by ``ratio`` times the last step's motion."""
        held, last = self._held, state.motion
        motion = base[held] - state.base[held]
        start, rest, slides, turns = state.positions.copy(), motion, state.slides, state.turns
        if last is not None and ratio != 0.0:
            rest = motion - ratio * last.base
            slides, turns = slides + ratio * last.slides, turns + ratio * last.turns
            start += ratio * last.move
        if self._handles.turn:
            target = self._handles.apply_free_motion(base, slides, turns)[held]
            rest = np.where(self._turning[:, None], target - start[held], rest)
        if np.abs(rest).max(initial=0.0) > self.STILL * self._size:
            start[self._free] += self._extend(start, rest)
        start[held] += rest
        return Prediction(state.with_(positions=start, base=base, slides=slides, turns=turns), ratio)

    def _extend(self, start: Array, rest: Array) -> Array:
        """Return the displacements (f, 3) [m] of free vertices if prescribed vertices move by ``rest`` (b, 3) [m]."""
        if not self._parts or np.abs(rest).max() <= self.FAR * self._size:
            return self._matrix.extend(rest)
        here, screws, sense = start[self._held], np.zeros((len(rest), 6)), np.zeros(3)
        for part in self._parts:
            screws[part] = screw = find_screw(here[part], here[part] + rest[part], sense)
            sense = sense if sense.any() else screw[:3]
        if np.abs(screws[:, :3]).max() <= self.FAR:
            return self._matrix.extend(rest)
        points, parts = start[self._free], (screws[:, :3], screws[:, 3:])
        moved = follow_screws(np.hstack([self._matrix.extend(part) for part in parts]), points) - points
        beside = rest - (follow_screws(screws, here) - here)  # more than rounding if a handle deforms
        return moved + self._matrix.extend(beside) if np.abs(beside).max() > self.STILL * self._size else moved

    def motion(self, old: State, new: State, change: Array) -> Motion:
        """Return the motion between two accepted states."""
        return Motion(
            move=new.positions - old.positions,
            base=new.base[self._held] - old.base[self._held],
            change=change,
            slides=new.slides - old.slides,
            turns=new.turns - old.turns,
        )


def _ratio(last: Motion | None, motion: Array, change: Array) -> float:
    """Return the multiple of the last motion that approximates the present motion; 0 if the two are not similar.

    Before the comparison, the displacements of handles are divided by the larger norm of the two motions, and the
    change of each command by the larger of its two changes.
    """
    if last is None:
        return 0.0
    scale = np.maximum(np.abs(change), np.abs(last.change))
    scale[scale == 0.0] = 1.0
    reach = max(_norm(motion), _norm(last.base)) or 1.0
    before = np.concatenate([last.base.ravel() / reach, last.change / scale])
    now = np.concatenate([motion.ravel() / reach, change / scale])
    ratio = float(np.vdot(before, now) / (np.vdot(before, before) or np.inf))
    smooth = _norm(now - ratio * before) <= Predictor.SMOOTH * _norm(now)
    return ratio if smooth and 0.0 < ratio <= Predictor.LARGEST_RATIO else 0.0


def _norm(vector: Array) -> float:
    return math.sqrt(np.vdot(vector, vector))


def find_screw(here: Array, there: Array, sense: Array) -> Array:
    """Return the screw (6,), w [rad] and v [m], of the rigid motion that best moves ``here`` (k, 3) [m] to ``there``.

    If the points lie on a line, their rotation is not unique, and their motion counts as a translation. A rotation by
    about 180 degrees gets the sense of the rotation vector ``sense`` (3,). Otherwise rounding could give two handles
    that turn together opposite senses, which would twist the body by a whole turn.
    """
    start, end = here.mean(axis=0), there.mean(axis=0)
    arms, moved = here - start, there - end
    if np.abs(moved - arms).max() <= LEAST_TURN * np.abs(arms).max() or _are_on_a_line(arms, moved):
        return np.concatenate([np.zeros(3), end - start])
    turn = Rotation.align_vectors(moved, arms)[0]
    vector = turn.as_rotvec()
    angle = float(np.linalg.norm(vector))
    if angle > HALF_TURN and vector @ sense < 0.0:
        vector *= 1.0 - 2.0 * np.pi / angle
    # exp(xi) moves a point by (J - I) x + J_l v; J_l is invertible below a whole turn.
    left = apply_left_jacobian(vector[None], np.eye(3)).T
    return np.concatenate([vector, np.linalg.solve(left, end - turn.apply(start))])


def _are_on_a_line(arms: Array, moved: Array) -> bool:
    """Return whether points with ``arms`` (k, 3) [m] from their mean, ``moved`` later, do not show how they turn."""
    spread = np.linalg.svd(moved.T @ arms, compute_uv=False)
    return not spread[1] > LEAST_TURN * spread[0]


def follow_screws(screws: Array, points: Array) -> Array:
    """Return points (n, 3) [m] after the motions of screws (n, 6), one for each point."""
    turn, velocity = screws[:, :3].copy(), screws[:, 3:]
    return points + apply_left_jacobian(turn, np.cross(turn, points) + velocity)
