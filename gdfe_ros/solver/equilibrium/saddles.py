# SPDX-License-Identifier: Apache-2.0
"""Leaving the equilibria that are saddles of the energy: look at a solution, step down from it, descend again."""

from __future__ import annotations

from typing import Protocol

from gdfe_ros.solver.deadline import past
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.history import History
from gdfe_ros.solver.descent.minimiser import Task
from gdfe_ros.solver.equilibrium.model import Model
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.equilibrium.stability import Stability
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import SoftDirection
from gdfe_ros.solver.tangent.curvature import FLAT
from gdfe_ros.solver.value import changed

MOST_SADDLES = 8
"""Saddles that are left in a solve, one after the other."""
STEP, ASK, LOOK = 4, 40, 500
"""What a step counts beside its iterations, and after how many of both the softest direction is asked again, which is
one product, and after how many it is looked for anew: each about a fortieth of the work of a stream."""
UNSTABLE = (
    "the equilibrium is unstable: a small push makes the body leave it; remedy: push it aside first, or step back"
)


class Descents(Protocol):
    """The equilibrium solver, as far as leaving a saddle needs it."""

    @property
    def model(self) -> Model:
        """What all solves have in common."""

    @property
    def whole(self) -> ActiveSet:
        """Everything that can move."""

    def task_at(self, solve: Solve, found: Solution) -> Task:
        """Return what would descend from a solution, with the multipliers as they are."""

    def descend(self, solve: Solve, active: ActiveSet, history: History, *, spent: int = 0) -> Solution:
        """Descend from where ``solve`` is."""


class Saddles:
    """Judges the stability of solutions and leaves those that are saddles.

    Args:
        stability: looks for directions along which the energy curves down.
        descents: solves again from below a saddle.
    """

    def __init__(self, stability: Stability, descents: Descents) -> None:
        self._stability, self._descents = stability, descents

    def judged(self, solve: Solve, found: Solution, *, part: bool) -> Solution:
        """Return a converged solution with what is known of its stability; look for that where it is due.

        A ``part`` of the body says nothing of the whole.
        """
        start, soft = solve.start, solve.start.soft
        if soft is not None:
            soft = soft.after(STEP + found.iterations)
        refused = found.state.tangent is not None and found.state.tangent.softest == 0.0
        if not part and (soft is None or refused or soft.looked >= LOOK):
            return self._left(solve, found)
        if start.summary.stable is False:  # nothing led down from there, and much was tried
            return _told(found, soft, stable=False)
        jumps = solve.anew or (self._descents.model.level is None and not solve.warm)
        if not part and (soft.asked >= ASK or jumps):
            if self._stability.curves_down(self._descents.task_at(solve, found), soft.direction):
                return self._left(solve, found)
            soft = changed(soft, asked=0)
        return _told(found, soft, stable=start.summary.stable)

    def _left(self, solve: Solve, found: Solution) -> Solution:
        """Leave an equilibrium that is a saddle of the energy, and those after it; tell whether the last is stable."""
        whole = self._descents.whole
        for _ in range(MOST_SADDLES):
            task = self._descents.task_at(solve, found)
            seen = self._stability.look(task)
            soft, history = SoftDirection(direction=seen.direction, asked=0, looked=0), whole.keeper.export()
            if seen.value > -FLAT:
                return _told(found, soft, stable=True if seen.known else None)
            down = None if past(solve.problem.deadline) else self._stability.leave(task, seen.direction)
            if down is None or found.iterations >= solve.problem.limit:
                break
            whole.workspace.u[...] = down.unknowns
            slides, turns = whole.rigid_motion()
            solve.leave_to(found.state.with_(positions=down.positions, slides=slides, turns=turns))
            again = self._descents.descend(solve, whole, History.empty(), spent=found.iterations)
            spent = found.iterations + again.iterations
            if not (again.converged and again.min_det > 0.0):
                whole.keeper.load(history)
                return _told(changed(found, iterations=spent), soft, stable=False)
            found = changed(again, iterations=spent)
        return _told(found, soft, stable=False)


def _told(found: Solution, soft: SoftDirection | None, *, stable: bool | None) -> Solution:
    """Return a solution with what is known of its stability, and with a remark where it is unstable."""
    message = found.message if stable is not False else f"{UNSTABLE}; {found.message}".rstrip("; ")
    summary = changed(found.state.summary, stable=stable, message=message)
    return changed(found, state=found.state.with_(summary=summary, soft=soft))
