# SPDX-License-Identifier: Apache-2.0
"""Progress of a time step: internal steps, prediction of their end, and the consequences of their outcomes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.equilibrium.predictor import Prediction, Predictor
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.motion import inertia
from gdfe_ros.solver.motion.scheme import Kinematics
from gdfe_ros.solver.settings import Dynamics
from gdfe_ros.solver.solution import PathResult, Solution
from gdfe_ros.solver.state import Failure, State, replace_fields
from gdfe_ros.solver.stepping.path import Path, Verdict
from gdfe_ros.solver.vectors import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class TimePath(Path):
    """A time step in progress.

    Attributes:
        duration: duration of the whole step [s].
        flaw: message of the first failure; empty for none.
    """

    WHOLE = 16
    DEEPEST_FOLD = -0.5
    """Without a driving command, the body may continue to move with corners' volume ratios above this: barriers open
    the folds.
    """

    duration: float
    flaw: str = ""

    def repeats(self, failure: Failure) -> bool:
        """Return whether this step would only repeat ``failure``.

        Its poses and commands must be those of the failure. A driven body must also have the same duration and length
        of internal steps; for any other body, internal steps that are at least as long are enough.
        """
        goal = self.goal.poses, self.goal.commands
        if goal != (failure.poses, failure.commands):
            return False
        if (self.state.poses, self.state.commands) == goal:
            return self.longest >= failure.length
        return (self.duration, self.longest) == (failure.duration, failure.length)

    @property
    def length(self) -> float:
        """Length [s] of the next internal step. It is rounded to nine digits: each new length costs a factorisation."""
        return float(f"{self.duration / (self.total / self.size):.9g}")

    @property
    def longest(self) -> float:
        """Length [s] of an internal step that is not halved."""
        return self.duration / (self.total / self.WHOLE)

    @property
    def can_halve(self) -> bool:
        """Whether the next internal step may be halved."""
        return self.size > 1

    @property
    def driven(self) -> bool:
        """Whether a handle or a command moves in the next internal step."""
        return self.next_place != (self.state.poses, self.state.commands)

    def endures(self, solution: Solution) -> bool:
        """Return whether the simulation accepts a solution with folded elements, as not converged, and continues.

        It continues if no shorter step is left, no command drives the body, and corners are folded only slightly. Fold
        barriers then open these corners in the following steps.
        """
        return not (self.can_halve or self.driven or solution.diverged) and solution.min_det > self.DEEPEST_FOLD

    def advance(self, state: State) -> TimePath:
        """Return the path after an internal step to ``state``; after two halved steps, the length is doubled again."""
        gone, summary = super().advance(state), state.summary
        size = min(self.WHOLE, self.size * 2) if gone.done % (2 * self.size) == 0 else self.size
        return replace_fields(gone, size=size, flaw=self.flaw or ("" if summary.converged else summary.message))

    def result(self, skipped: dict[str, int]) -> PathResult:
        """Return the outcome of the step so far."""
        flaw, simulated = self.flaw, self.duration * self.covered
        if not self.completed:
            flaw = f"simulated {simulated:.6g} of {self.duration:.6g} s: {flaw or self.state.summary.message}"
        flawed = replace_fields(self, state=self.state.with_flaw(flaw)) if flaw else self
        return super(TimePath, flawed).result(skipped, simulated=simulated)

    def withdraw(self, solution: Solution, skipped: dict[str, int], *, hurried: bool) -> PathResult:
        """Return the outcome at the state before a failed internal step.

        If the first internal step fails at its shortest length, the failure is recorded for later steps, unless the
        deadline has passed (``hurried``).
        """
        reason, least = solution.message, self.state.summary.min_det
        text = f"an internal step of {self.length:.3g} s failed: {reason}".rstrip("; ")
        text = f"{text}; positions and velocities are those before it"
        if least > 0.0:
            remedy = "slower commands" if self.driven else "a stiffer material"
            text = f"{text}; remedy: {remedy}, a smaller dynamics.step, or a reset"
        else:
            text = f"{text}, where elements are inside out already (least volume ratio {least:.3g}); remedy: a reset"
        failure = None
        if not (self.done or self.can_halve or hurried):
            asked = {"poses": self.goal.poses, "commands": self.goal.commands}
            failure = Failure(**asked, duration=self.duration, length=self.longest, reason=text)
        state = self.state.with_(ledger=replace_fields(self.state.ledger, failure=failure))
        return replace_fields(self, state=state.with_flaw(text, error_estimate=math.inf), flaw=text).result(skipped)


class MotionPredictor(Predictor):
    """Predicts the end of a step of one length from a state and its velocities.

    Args:
        body: the discretised body.
        handles: the kinematics of its handles.
        matrix: the constant matrix.
        h: length of the step [s].
        masses: (n,) masses of the vertices [kg].
    """

    SHARES = (1.0, 0.5, 0.25, 0.125, 0.0)
    """Fractions of the free flight that are tried in turn until no element is folded. In the free flight, a force on
    one light vertex may move it across many cells, and a start with folds ends in another equilibrium. Without handles,
    the centre of mass always moves by the whole free flight: the minimisation would correct its position only to within
    the tolerance, and momentum would change.
    """

    def __init__(self, body: Body, handles: HandleMotions, matrix: ConstantMatrix, h: float, masses: Array) -> None:
        super().__init__(body, handles, matrix)
        self._h = h
        self._shares = np.zeros_like(masses) if body.handles else masses / masses.sum()

    def predict(self, state: State, base: Array, change: Array) -> Prediction:
        """Return the start of a solve that moves the handles from ``state`` to ``base`` (n, 3) [m]."""
        now, h, last, held = Kinematics.of(state.terms[inertia.NAME]), self._h, state.motion, self._held
        slides, turns = state.slides, state.turns
        if last is not None:
            slides, turns = slides + last.slides, turns + last.turns
        flight = h * now.velocity + 0.5 * h * h * now.trend
        drift, led = self._shares @ flight, state.positions.copy()
        led[held] += base[held] - state.base[held]
        for share in (*self.SHARES, 1.0):  # handles may fold elements whatever the other vertices do
            start = led.copy()
            fly(start, flight, drift, share, self._free)
            if least_volume_ratio(start, self._shape) > 0.0:
                break
        return Prediction(state.with_(positions=start, base=base, slides=slides, turns=turns), 1.0)


@kernel
def fly(x, flight, drift, share, free):
    """Move the ``free`` vertices (f,) of ``x`` (n, 3) [m] by ``share`` of their ``flight`` (n, 3), else by ``drift``.

    All vertices have the same ``drift`` (3,).
    """
    for v in free:
        for i in range(3):
            x[v, i] += share * flight[v, i] + (1.0 - share) * drift[i]


ACCURACY, FINEST = 3.0, 1e-4
"""`reduction` is the first number times the motion divided by the body's size, at least the second number, and at most
1.
"""


def reduction(moved: float, size: float) -> float:
    """Return the factor of the tolerance in an internal step in which a body of ``size`` [m] moves by ``moved`` [m]."""
    return min(1.0, max(FINEST, ACCURACY * moved / size))


@dataclass(frozen=True, eq=False, kw_only=True)
class InternalStep:
    """An accepted internal step, for observers of a motion.

    Attributes:
        before, after: states before and after the internal step.
        h: its length [s].
        share: fraction of the whole step's change of commands that is completed after the internal step.
        dynamics: its scheme and damping; None for the start of a motion, which only computes the accelerations of
            ``after``.
    """

    before: State
    after: State
    h: float
    share: float = 0.0
    dynamics: Dynamics | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """A solved internal step, and its consequence.

    Attributes:
        path: the path at the state before the trial, with the iterations of the trial counted.
        solution: the last solution.
        verdict: the consequence; `Verdict.STOP` if an interruption ended the solve.
        step: the internal step; None if it is not accepted.
    """

    path: TimePath
    solution: Solution
    verdict: Verdict
    step: InternalStep | None = None


def is_unfolded(solution: Solution) -> bool:
    """Return whether no element is folded or inverted."""
    return not solution.diverged and solution.min_det > 0.0


def has_failed(solution: Solution) -> bool:
    """Return whether a solution failed and a shorter step may succeed."""
    stuck = not (solution.converged or solution.exhausted)
    return stuck or not is_unfolded(solution)
