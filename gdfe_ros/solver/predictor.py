# SPDX-License-Identifier: Apache-2.0
"""Where to start a step: linear extrapolation of smooth motion, the harmonic predictor for the rest (DESIGN 5.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.scope import Movable
from gdfe_ros.solver.unknowns import Unknowns

LARGEST_RATIO = 2.0
SMOOTH = 0.5


@dataclass(frozen=True)
class Prediction:
    """Start positions (n, 3) [m] and the share of the last step that was repeated."""

    positions: NDArray[np.float64]
    ratio: float


class Predictor:
    """Remembers the last two states and starts the next step from them."""

    def __init__(self, unknowns: Unknowns) -> None:
        self._prescribed = unknowns.prescribed
        self.reset()

    def reset(self) -> None:
        """Forget the motion so far."""
        self._last_move: NDArray[np.float64] | None = None
        self._last_motion: NDArray[np.float64] | None = None
        self._last_change = np.zeros(0)

    def predict(
        self,
        positions: NDArray[np.float64],
        old_base: NDArray[np.float64],
        base: NDArray[np.float64],
        change: NDArray[np.float64],
        movable: Movable,
    ) -> Prediction:
        """Return where to start when the plates go from ``old_base`` to ``base`` (n, 3) [m].

        ``change`` (k,) is by how much the commands of actuators and loads change; only what is ``movable`` moves.
        """
        held = self._prescribed
        motion = base[held] - old_base[held]
        ratio = self._ratio(motion, change)
        start = positions.copy()
        rest = motion
        if ratio != 0.0:
            rest = motion - ratio * self._last_motion
            for rows in (slice(None),) if not len(movable.held) else (movable.unknowns.free, held):
                start[rows] += ratio * self._last_move[rows]
        if rest.any():
            start[held] += rest
            start[movable.unknowns.free] += movable.matrix.extend(rest)
        return Prediction(start, ratio)

    def carry(
        self, positions: NDArray[np.float64], motion: NDArray[np.float64], movable: Movable
    ) -> NDArray[np.float64]:
        """Return positions (n, 3) [m] after their plates moved by ``motion`` (n, 3), which the body follows."""
        held, start = self._prescribed, positions.copy()
        if motion[held].any():
            start[held] += motion[held]
            start[movable.unknowns.free] += movable.matrix.extend(motion[held])
        return start

    def remember(
        self,
        positions: NDArray[np.float64],
        new_positions: NDArray[np.float64],
        old_base: NDArray[np.float64],
        base: NDArray[np.float64],
        change: NDArray[np.float64],
    ) -> None:
        """Keep the step that was just accepted."""
        held = self._prescribed
        self._last_move = new_positions - positions
        self._last_motion = base[held] - old_base[held]
        self._last_change = change

    def _ratio(self, motion: NDArray[np.float64], change: NDArray[np.float64]) -> float:
        """Return how much of the last motion this one repeats, 0 where it is another motion.

        Plates and commands count alike, each in units of the larger of its last two changes.
        """
        if self._last_motion is None:
            return 0.0
        if len(change):
            scale = np.maximum(np.abs(change), np.abs(self._last_change))
            scale[scale == 0.0] = 1.0
            reach = max(np.linalg.norm(motion), np.linalg.norm(self._last_motion)) or 1.0
            motion = np.concatenate([motion.ravel() / reach, change / scale])
            last = np.concatenate([self._last_motion.ravel() / reach, self._last_change / scale])
            return self._repeated(last, motion)
        return self._repeated(self._last_motion, motion)

    @staticmethod
    def _repeated(last: NDArray[np.float64], motion: NDArray[np.float64]) -> float:
        size = np.vdot(last, last)
        if size == 0.0:
            return 0.0
        ratio = float(np.vdot(last, motion) / size)
        rest = np.linalg.norm(motion - ratio * last)
        smooth = rest <= SMOOTH * np.linalg.norm(motion) and 0.0 < ratio <= LARGEST_RATIO
        return ratio if smooth else 0.0
