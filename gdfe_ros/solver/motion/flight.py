# SPDX-License-Identifier: Apache-2.0
"""Progress of a time step: internal steps of equal length, which are halved on failure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import Failure, State
from gdfe_ros.solver.stepping.march import March
from gdfe_ros.solver.stepping.path import on_path
from gdfe_ros.solver.value import NEGLIGIBLE, changed

HALVINGS = 4
"""How often a failing internal step may be halved."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Flight:
    """A time step in progress.

    Attributes:
        state: the present state.
        began: the state at the beginning.
        poses, commands: targets at the end of the step.
        duration: duration of the whole step [s].
        total: number of units of the whole step.
        done: number of completed units.
        size: number of units of the next internal step.
        iterations, attempts: numbers of iterations and of attempted internal steps so far.
        flaw: message of the first failure; empty for none.
    """

    WHOLE = 2**HALVINGS
    """Number of units of an internal step that is not halved."""
    DEEPEST_FOLD = -0.5
    """An undriven motion continues if every corner's volume ratio is above this; fold barriers then open the folds."""

    state: State
    began: State
    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    duration: float
    total: int
    done: int = 0
    size: int = WHOLE
    iterations: int = 0
    attempts: int = 0
    flaw: str = ""

    @classmethod
    def over(
        cls, duration: float, longest: float, state: State, poses: Mapping[str, Pose], commands: Mapping[str, float]
    ) -> Flight:
        """Return the flight that divides ``duration`` [s] into equal internal steps of at most ``longest`` [s]."""
        count = max(1, math.ceil(duration / longest - NEGLIGIBLE))
        return cls(state=state, began=state, poses=poses, commands=commands, duration=duration, total=cls.WHOLE * count)

    def repeats(self, failure: Failure) -> bool:
        """Return whether this step would only repeat ``failure``; a driven body may succeed with another duration."""
        if (self.poses, self.commands) != (failure.poses, failure.commands):
            return False
        if (self.state.poses, self.state.commands) == (self.poses, self.commands):
            return self.longest >= failure.length
        return (self.duration, self.longest) == (failure.duration, failure.length)

    @property
    def arrived(self) -> bool:
        """Whether the whole step is completed."""
        return self.done >= self.total

    @property
    def length(self) -> float:
        """Length [s] of the next internal step, rounded to nine digits because each new length needs a factor."""
        return float(f"{self.duration / (self.total / self.size):.9g}")

    @property
    def longest(self) -> float:
        """Length [s] of an internal step that is not halved."""
        return self.duration / (self.total / self.WHOLE)

    @property
    def aim(self) -> tuple[Mapping[str, Pose], Mapping[str, float]]:
        """Poses and commands at the end of the next internal step."""
        began, goal = (self.began.poses, self.began.commands), (self.poses, self.commands)
        return on_path(began, goal, (self.done + self.size) / self.total)

    @property
    def can_halve(self) -> bool:
        """Whether the next internal step may be halved."""
        return self.size > 1

    @property
    def driven(self) -> bool:
        """Whether a handle or a command moves in the next internal step."""
        return self.aim != (self.state.poses, self.state.commands)

    def endures(self, solution: Solution) -> bool:
        """Return whether the simulation accepts a solution with folded elements, as not converged, and continues.

        It continues if no shorter step is left, no command drives the body, and corners are folded only slightly. Fold
        barriers then open these corners in the following steps.
        """
        return not (self.can_halve or self.driven or solution.diverged) and solution.min_det > self.DEEPEST_FOLD

    def tried(self, solution: Solution) -> Flight:
        """Return the flight with the iterations of an attempted internal step added."""
        return changed(self, iterations=self.iterations + solution.iterations, attempts=self.attempts + 1)

    def halved(self) -> Flight:
        """Return the flight with the next internal step halved."""
        return changed(self, size=self.size // 2)

    def went(self, state: State) -> Flight:
        """Return the flight after an internal step to ``state``; after two halves, twice the length is tried again."""
        done = self.done + self.size
        size = min(self.WHOLE, self.size * 2) if done % (2 * self.size) == 0 else self.size
        return changed(self, state=state, done=done, size=size, flaw=self.flaw or self._flaw(state))

    def march(self, skipped: dict[str, int]) -> March:
        """Return the outcome of the step so far."""
        flaw, arrived = self.flaw, self.arrived
        if not arrived:
            flaw = f"simulated {self.simulated:.6g} of {self.duration:.6g} s: {flaw or self.state.summary.message}"
        state, message = self.state, flaw or self.state.summary.message
        if (not flaw, message) != (state.summary.converged, state.summary.message):
            state = state.with_(summary=changed(state.summary, converged=not flaw, message=message))
        return March(
            state=state,
            iterations=self.iterations,
            increments=self.attempts,
            reached=arrived,
            converged=not flaw,
            message=message,
            skipped=skipped,
            simulated=self.simulated,
        )

    def withdrawn(self, solution: Solution, skipped: dict[str, int], *, hurried: bool) -> March:
        """Return the outcome at the state before a failed internal step, with the failure unless ``hurried``.

        The failure is recorded for later steps if the first internal step fails at its shortest length. ``hurried``
        states that the deadline has passed.
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
            asked = {"poses": self.poses, "commands": self.commands}
            failure = Failure(**asked, duration=self.duration, length=self.longest, reason=text)
        state = self.state.with_(
            ledger=changed(self.state.ledger, failure=failure),
            summary=changed(self.state.summary, error_estimate=math.inf),
        )
        return changed(self, state=state, flaw=text).march(skipped)

    @property
    def simulated(self) -> float:
        """Simulated part of ``duration`` [s]."""
        return self.duration if self.arrived else self.duration * self.done / self.total

    @staticmethod
    def _flaw(state: State) -> str:
        return "" if state.summary.converged else state.summary.message
