# SPDX-License-Identifier: Apache-2.0
"""Progress of a time step: internal steps of equal length, which are halved on failure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import Failure, State
from gdfe_ros.solver.stepping.march import March
from gdfe_ros.solver.stepping.path import Path
from gdfe_ros.solver.value import changed


@dataclass(frozen=True, eq=False, kw_only=True)
class Flight(Path):
    """A time step in progress.

    Attributes:
        duration: duration of the whole step [s].
        flaw: message of the first failure; empty for none.
    """

    WHOLE = 16
    DEEPEST_FOLD = -0.5
    """An undriven motion continues if every corner's volume ratio is above this; fold barriers then open the folds."""

    duration: float
    flaw: str = ""

    def repeats(self, failure: Failure) -> bool:
        """Return whether this step would only repeat ``failure``; a driven body may succeed with another duration."""
        goal = self.goal.poses, self.goal.commands
        if goal != (failure.poses, failure.commands):
            return False
        if (self.state.poses, self.state.commands) == goal:
            return self.longest >= failure.length
        return (self.duration, self.longest) == (failure.duration, failure.length)

    @property
    def length(self) -> float:
        """Length [s] of the next internal step, rounded to nine digits because each new length needs a factor."""
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
        return self.aim != (self.state.poses, self.state.commands)

    def endures(self, solution: Solution) -> bool:
        """Return whether the simulation accepts a solution with folded elements, as not converged, and continues.

        It continues if no shorter step is left, no command drives the body, and corners are folded only slightly. Fold
        barriers then open these corners in the following steps.
        """
        return not (self.can_halve or self.driven or solution.diverged) and solution.min_det > self.DEEPEST_FOLD

    def went(self, state: State) -> Flight:
        """Return the flight after an internal step to ``state``; after two halves, twice the length is tried again."""
        gone, summary = super().went(state), state.summary
        size = min(self.WHOLE, self.size * 2) if gone.done % (2 * self.size) == 0 else self.size
        return changed(gone, size=size, flaw=self.flaw or ("" if summary.converged else summary.message))

    def march(self, skipped: dict[str, int]) -> March:
        """Return the outcome of the step so far."""
        flaw, simulated = self.flaw, self.duration * self.covered
        if not self.arrived:
            flaw = f"simulated {simulated:.6g} of {self.duration:.6g} s: {flaw or self.state.summary.message}"
        told = changed(self, state=self.state.flawed(flaw)) if flaw else self
        return super(Flight, told).march(skipped, simulated=simulated)

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
            asked = {"poses": self.goal.poses, "commands": self.goal.commands}
            failure = Failure(**asked, duration=self.duration, length=self.longest, reason=text)
        state = self.state.with_(ledger=changed(self.state.ledger, failure=failure))
        return changed(self, state=state.flawed(text, error_estimate=math.inf), flaw=text).march(skipped)
