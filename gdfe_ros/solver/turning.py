# SPDX-License-Identifier: Apache-2.0
"""Plates that turn freely: their rotations are found so that the body exerts no moment about the free axes.

By the envelope theorem the moment is the derivative of the potential, minimised over everything else, to the plate's
rotation. A Newton iteration on these few angles lowers that potential; its stiffness comes from differences once and
from secants (Broyden) afterwards. The constant matrix and the kernels know nothing of it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.outcome import Outcome, State

FINER, FINEST, TIGHTEN = 1e-2, 1e-5, 0.1
"""Tolerance of the solves at given rotations, over that of the step: their errors show in the moments. Where the
corrections no longer shrink, it is tightened by the last factor down to the second."""
PROBE = 1e-2
"""Turn [rad] of a difference."""
LARGEST = 0.3
"""Turn [rad] of one correction."""
ROUNDS = 40
MOST_REPEATED = 2.0
SECANT = 3.0
"""Correction, over the tolerance, that tells the stiffness."""
SLOWER, NOISE = 0.7, 10.0
"""Ratio of two corrections in a row above which they no longer shrink; where they are larger than ``NOISE`` tolerances
the stiffness is taken from differences again."""

Positions = NDArray[np.float64]


class Trials:
    """Equilibria one after the other, each from the last one with the plates moved on.

    Args:
        solve: finds the equilibrium from positions (n, 3) [m] with the plates at others (n, 3) [m], to a share of the
            step's tolerance.
        start: where to begin (n, 3) [m], with the plates at ``place()``.
        place: gives the plates' vertices (n, 3) [m] at the turns in hand.
        carry: moves positions along with the plates' motion (n, 3) [m].
        give_up: tells after how many iterations to stop, or that the time is up.

    Attributes:
        finer: that share.
        used: iterations so far.
        base: plates' vertices (n, 3) [m] of the last solve.
    """

    def __init__(
        self,
        solve: Callable[[Positions, Positions, float], tuple[Outcome, State]],
        start: Positions,
        *,
        place: Callable[[], Positions],
        carry: Callable[[Positions, Positions], Positions],
        give_up: Callable[[int], bool],
    ) -> None:
        self._solve, self._start, self._place, self._carry, self.give_up = solve, start, place, carry, give_up
        self.used, self.base, self.finer = 0, place(), FINER

    def solve(self) -> tuple[Outcome, State]:
        """Find the equilibrium at the turns in hand."""
        base = self._place()
        outcome, state = self._solve(self._carry(self._start, base - self.base), base, self.finer)
        self._start, self.base, self.used = outcome.positions, base, self.used + outcome.iterations
        return outcome, state


class Turning:
    """The free rotations of all plates, about world axes through the plates' centres.

    Args:
        body: the discretised body.

    Attributes:
        count: number of free rotations.
        names: of the plates that have some.
        turns: (k,) rotation-vector components [rad] of the last accepted step, handle by handle.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
        self._axes = [(handle, int(axis)) for handle in body.handles for axis in handle.turning]
        self.count, self.names = len(self._axes), frozenset(handle.name for handle, _ in self._axes)
        self._centres = {handle.name: handle.centre(body.rest) for handle in body.handles}
        self.reset()

    def reset(self) -> None:
        """Go back to rest."""
        self.turns, self.trial = np.zeros(self.count), np.zeros(self.count)
        self._move, self._motion = np.zeros(self.count), np.zeros(0)
        self._stiffness: NDArray[np.float64] | None = None

    def pose(self, name: str, commanded: Pose) -> Pose:
        """Return the pose of a plate at the turns in hand; components of the command about free axes are not read."""
        mine = [(i, axis) for i, (handle, axis) in enumerate(self._axes) if handle.name == name]
        if not mine:
            return commanded
        turn, rest = np.zeros(3), np.array(commanded.rotation)
        for i, axis in mine:
            turn[axis], rest[axis] = self.trial[i], 0.0
        if not rest.any():
            return Pose(commanded.translation, tuple(turn))
        together = Rotation.from_rotvec(turn) * Rotation.from_rotvec(rest)
        return Pose(commanded.translation, tuple(together.as_rotvec()))

    def place(self, positions: Positions, poses: Mapping[str, Pose]) -> Positions:
        """Return positions (n, 3) [m] with the named plates' vertices at commanded poses and the turns in hand."""
        base = positions.copy()
        for handle in self._body.handles:
            if handle.name not in poses:
                continue
            pose = self.pose(handle.name, poses[handle.name])
            base[handle.vertices] = pose.apply(self._body.rest[handle.vertices], self._centres[handle.name])
        return base

    def guess(self, poses: Mapping[str, Pose], last: Mapping[str, Pose], change: NDArray[np.float64]) -> None:
        """Turn on as before where the commands, of plates and of actuators, go on as before."""
        if not self.count:
            return
        motion = _motion(poses, last, change, self._body.size)
        size = float(np.vdot(self._motion, self._motion))
        ratio = float(np.vdot(self._motion, motion)) / size if size > 0.0 else 0.0
        self.trial = self.turns + min(max(ratio, 0.0), MOST_REPEATED) * self._move

    def accept(self, poses: Mapping[str, Pose], last: Mapping[str, Pose], change: NDArray[np.float64]) -> None:
        """Keep the turns in hand as those of an accepted step."""
        if not self.count:
            return
        self._motion = _motion(poses, last, change, self._body.size)
        self._move, self.turns = self.trial - self.turns, self.trial.copy()

    def balance(self, trials: Trials, *, tolerance: float) -> tuple[Outcome, State, Positions]:
        """Turn the plates until no moment is left about their free axes.

        Args:
            trials: the equilibria at given turns.
            tolerance: largest turn [rad] left to do; it moves no vertex by more than this share of the body's size.

        Returns:
            The equilibrium with the iterations of all solves, not converged where moments are left; its state; the
            plates' positions.
        """
        turns, last, doubtful = self.trial, np.inf, self._stiffness is None
        outcome, state, moments = self._solve(trials, turns)
        for _ in range(ROUNDS):
            if not outcome.converged or trials.give_up(trials.used):
                break
            measured = doubtful
            if measured:
                self._measure(trials, turns, moments)
            step = self._step(moments)
            size = float(np.abs(step).max())
            if size <= tolerance:
                if measured:
                    outcome, state, moments = self._solve(trials, turns)
                return dataclasses.replace(outcome, iterations=trials.used), state, trials.base
            stuck = size > SLOWER * last and not measured
            if stuck:
                trials.finer = max(FINEST, TIGHTEN * trials.finer)
            doubtful = stuck and size > NOISE * tolerance
            last = np.inf if stuck else size
            if not doubtful:
                turns, before = turns + step, moments
                outcome, state, moments = self._solve(trials, turns)
                if size > SECANT * tolerance:
                    miss = moments - before - self._stiffness @ step
                    self._stiffness = self._stiffness + np.outer(miss, step) / np.vdot(step, step)
        text = f"plates that turn freely are left with moments up to {np.abs(moments).max():.3g} N m"
        outcome = dataclasses.replace(outcome, converged=False, iterations=trials.used, message=outcome.message or text)
        return outcome, state, trials.base

    def _solve(self, trials: Trials, turns: NDArray[np.float64]) -> tuple[Outcome, State, NDArray[np.float64]]:
        self.trial = turns
        outcome, state = trials.solve()
        return outcome, state, np.array([state.reactions[handle.name][3 + axis] for handle, axis in self._axes])

    def _measure(self, trials: Trials, turns: NDArray[np.float64], moments: NDArray[np.float64]) -> None:
        """Take the stiffness (k, k) [N m/rad] from differences."""
        ways = PROBE * np.eye(self.count)
        columns = [(self._solve(trials, turns + way)[2] - moments) / PROBE for way in ways]
        self._stiffness = np.stack(columns, axis=1)

    def _step(self, moments: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return Newton's step towards less potential, no component above ``LARGEST``."""
        values, vectors = np.linalg.eigh(0.5 * (self._stiffness + self._stiffness.T))
        least = 1e-9 * np.abs(values).max() or 1.0
        step = -vectors @ ((vectors.T @ moments) / np.maximum(np.abs(values), least))
        return step * min(1.0, LARGEST / max(np.abs(step).max(), 1e-300))


def _motion(
    poses: Mapping[str, Pose], last: Mapping[str, Pose], change: NDArray[np.float64], size: float
) -> NDArray[np.float64]:
    """Return what commands change: translations over the body's size, turns [rad], actuators in their own units."""
    ways = [
        [*np.subtract(pose.translation, last[name].translation) / size,
         *np.subtract(pose.rotation, last[name].rotation)]
        for name, pose in poses.items()
    ]  # fmt: skip
    return np.concatenate([np.ravel(ways), change])
