# SPDX-License-Identifier: Apache-2.0
"""Start of a step: linear extrapolation of a smooth motion, and harmonic extension of the handles' remaining motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.barrier import THRESHOLD
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Motion, State

LARGEST_RATIO = 2.0
"""Largest multiple of the last step that is extrapolated."""
SMOOTH = 0.5
"""The last motion is extrapolated if the present motion differs from a multiple of it by at most this fraction."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """Start of a solve.

    Attributes:
        positions: (n, 3) [m].
        slides, turns: (p, 3) free motions of handles [m], [rad].
        ratio: multiple of the last step that was extrapolated.
    """

    positions: NDArray[np.float64]
    slides: NDArray[np.float64]
    turns: NDArray[np.float64]
    ratio: float


class Predictor:
    """Predicts the end of a step from a state and its last motion.

    Args:
        body: the discretised body.
        handles: the kinematics of its handles.
        matrix: the constant matrix, which spreads motions of handles over the body.
    """

    STILL = 1e-12
    """Handle displacement, divided by the body's size, that counts as rounding and is not extended to the free
    vertices.
    """
    FAR = 1e-2
    """Extrapolated displacements below this multiple of the body's size fold no element."""

    def __init__(self, body: Body, handles: HandleMotions, matrix: ConstantMatrix) -> None:
        self._free, self._matrix = body.unknowns.free, matrix
        self._held, self._handles, self._size = body.unknowns.prescribed, handles, body.size
        self._shape = body.shape
        self._turning = handles.turning_vertices()

    def predict(self, state: State, base: NDArray[np.float64], change: NDArray[np.float64]) -> Prediction:
        """Return the start of a solve that moves the handles from ``state`` to ``base`` (n, 3) [m].

        ``change`` (c,) are the changes of the commands of actuators and loads. A motion
        whose extrapolation folds elements is not extrapolated.
        """
        motion = base[self._held] - state.base[self._held]
        ratio = _ratio(state.motion, motion, change)
        found = self._predicted(state, base, ratio)
        if ratio != 0.0 and self._is_far(state, ratio) and least_volume_ratio(found.positions, self._shape) < THRESHOLD:
            return self._predicted(state, base, 0.0)
        return found

    def _is_far(self, state: State, ratio: float) -> bool:
        """Return whether the extrapolated motion is so long that it may fold elements."""
        return ratio * float(np.abs(state.motion.move).max()) > self.FAR * self._size

    def _predicted(self, state: State, base: NDArray[np.float64], ratio: float) -> Prediction:
        """Return the start with the last motion extrapolated by ``ratio``."""
        held, last = self._held, state.motion
        motion = base[held] - state.base[held]
        start, rest, slides, turns = state.positions.copy(), motion, state.slides, state.turns
        if last is not None and ratio != 0.0:
            rest = motion - ratio * last.base
            slides, turns = slides + ratio * last.slides, turns + ratio * last.turns
            start += ratio * last.move
        if self._handles.turn:
            target = self._handles.placed(base, slides, turns)[held]
            rest = np.where(self._turning[:, None], target - start[held], rest)
        start[held] += rest
        if np.abs(rest).max(initial=0.0) > self.STILL * self._size:
            start[self._free] += self._matrix.extend(rest)
        return Prediction(start, slides, turns, ratio)

    def motion(self, old: State, new: State, change: NDArray[np.float64]) -> Motion:
        """Return the motion between two accepted states."""
        return Motion(
            move=new.positions - old.positions,
            base=new.base[self._held] - old.base[self._held],
            change=change,
            slides=new.slides - old.slides,
            turns=new.turns - old.turns,
        )


def _ratio(last: Motion | None, motion: NDArray[np.float64], change: NDArray[np.float64]) -> float:
    """Return the multiple of the last motion that approximates the present motion; 0 if the two are not similar.

    Before the comparison, the displacements of handles are divided by the larger norm of the two motions, and the
    change of each command by the larger of its two changes.
    """
    if last is None:
        return 0.0
    if len(change):
        scale = np.maximum(np.abs(change), np.abs(last.change))
        scale[scale == 0.0] = 1.0
        reach = max(_norm(motion), _norm(last.base)) or 1.0
        motion = np.concatenate([motion.ravel() / reach, change / scale])
        return _repeated(np.concatenate([last.base.ravel() / reach, last.change / scale]), motion)
    return _repeated(last.base, motion)


def _repeated(last: NDArray[np.float64], motion: NDArray[np.float64]) -> float:
    size = np.vdot(last, last)
    if size == 0.0:
        return 0.0
    ratio = float(np.vdot(last, motion) / size)
    rest = _norm(motion - ratio * last)
    smooth = rest <= SMOOTH * _norm(motion) and 0.0 < ratio <= LARGEST_RATIO
    return ratio if smooth else 0.0


def _norm(vector: NDArray[np.float64]) -> float:
    return math.sqrt(np.vdot(vector, vector))
