# SPDX-License-Identifier: Apache-2.0
"""Internal steps of a motion: as they are tried, and as observers see them."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.solver.motion import inertia
from gdfe_ros.solver.motion.flight import Flight
from gdfe_ros.solver.motion.integrator import Integrator
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import State


@dataclass(frozen=True, eq=False, kw_only=True)
class InternalStep:
    """An accepted internal step, for observers of a motion.

    Attributes:
        before, after: states before and after the internal step.
        h: its length [s].
        share: fraction of the whole step's change of commands that is completed after the internal step.
        integrator: the integrator that made it; None for the start of a motion, which only computes the accelerations
            of ``after``.
        first: whether it is the first internal step of a motion.
    """

    before: State
    after: State
    h: float
    share: float = 0.0
    integrator: Integrator | None = None
    first: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """A solved internal step, and what follows from it.

    Attributes:
        flight: the flight, with the iterations of the trial.
        solution: the last solution.
        h: length of the internal step [s].
        integrator: the integrator of the last solution.
        interrupted: whether an interruption ended the solve.
        halves: whether a shorter internal step has to be tried.
        accepted: the state after the internal step; None if it is not accepted.
    """

    flight: Flight
    solution: Solution
    h: float
    integrator: Integrator
    interrupted: bool = False
    halves: bool = False
    accepted: State | None = None

    def observed(self, before: State, after: State, share: float) -> InternalStep:
        """Return this internal step, from ``before`` to ``after``, for observers; ``share`` as in `InternalStep`."""
        first = bool(before.terms[inertia.NAME]["first"][0])
        given = {"h": self.h, "share": share, "integrator": self.integrator, "first": first}
        return InternalStep(before=self.integrator.begun(before), after=after, **given)


def unfolded(solution: Solution) -> bool:
    """Return whether no element is folded or inverted."""
    return not solution.diverged and solution.min_det > 0.0


def failed(solution: Solution) -> bool:
    """Return whether a solution failed and a shorter step may succeed."""
    stuck = not (solution.converged or solution.exhausted)
    return stuck or not unfolded(solution)
