# SPDX-License-Identifier: Apache-2.0
"""Escape from saddles of the energy: check the stability of a solution, step down from a saddle, minimise again."""

from __future__ import annotations

from typing import Protocol

from gdfe_ros.solver.deadline import past
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.history import UpdateHistory
from gdfe_ros.solver.descent.minimiser import Task
from gdfe_ros.solver.equilibrium.model import Model
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.equilibrium.stability import Stability
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import SoftDirection
from gdfe_ros.solver.tangent.curvature import FLAT, Lowest
from gdfe_ros.solver.value import changed

MOST_SADDLES = 8
"""Largest number of saddles that one solve leaves in succession."""
STEP, ASK, AGAIN, LOOK = 4, 40, 150, 500
"""Numbers of iterations. A step counts as its own iterations plus `STEP`. Along the softest direction, the curvature is
evaluated every `ASK` iterations, with one product. The direction is computed anew every `LOOK` iterations, with 20 to
50 products, or every `AGAIN` iterations if the curvature along it has changed much.
"""
CHANGE = 0.5
"""Relative change of the curvature along the softest direction that counts as much: another direction may be softer."""
RISE, GROWTH = 1.25, 10.0
"""The curvature is also evaluated if the strain energy has risen by the factor `RISE` since it was evaluated last, and
the direction is computed anew if the energy has grown by the factor `GROWTH` since then: a few steps, each of few
iterations, may lead far beyond a buckling load.
"""
UNSTABLE = (
    "the equilibrium is unstable: a small push makes the body leave it; remedy: push it aside first, or step back"
)


class Descents(Protocol):
    """The part of the equilibrium solver that `Saddles` needs to leave a saddle."""

    @property
    def model(self) -> Model:
        """The data common to all solves."""

    @property
    def whole(self) -> ActiveSet:
        """The active set of the whole body."""

    def task_at(self, solve: Solve, found: Solution) -> Task:
        """Return the minimisation's task at a solution, with unchanged multipliers."""

    def descend(self, solve: Solve, active: ActiveSet, history: UpdateHistory, *, spent: int = 0) -> Solution:
        """Return the solution of minimisations and multiplier updates from the present positions of ``solve``."""


class Saddles:
    """Checks the stability of solutions, and leaves saddles.

    Args:
        stability: finds directions of negative curvature.
    """

    def __init__(self, stability: Stability) -> None:
        self._stability = stability

    def judged(self, descents: Descents, solve: Solve, found: Solution, *, part: bool) -> Solution:
        """Return a converged solution with its stability, which is checked only at intervals.

        A solution of a ``part`` of the body is not checked, because it does not prove the stability of the whole body.
        If the solution is a saddle, ``descents`` minimises again from a point of lower energy beside it.
        """
        start, soft = solve.start, solve.start.soft
        if soft is not None:
            soft = soft.after(STEP + found.iterations)
        energy, tangent = found.state.summary.energy, found.state.tangent
        refused = tangent is not None and tangent.softest == 0.0
        if not part and (soft is None or refused or soft.looked >= LOOK or energy > GROWTH * soft.looked_at):
            return self._left(descents, solve, found)
        if start.summary.stable is False:  # no descent was found from there, at great cost
            return _told(found, soft, stable=False)
        jumps = solve.anew or (descents.model.level is None and not solve.warm)
        if not part and (soft.asked >= ASK or jumps or energy > RISE * soft.asked_at):
            curvature = self._stability.curvature(descents.task_at(solve, found), soft.direction)
            other = soft.looked >= AGAIN and abs(curvature - soft.curvature) > CHANGE * soft.curvature
            if other or curvature < -FLAT:
                return self._left(descents, solve, found)
            soft = changed(soft, asked=0, asked_at=energy)
        return _told(found, soft, stable=start.summary.stable)

    def _left(self, descents: Descents, solve: Solve, found: Solution) -> Solution:
        """Leave saddles, at most `MOST_SADDLES` one after the other; return the last solution with its stability."""
        whole = descents.whole
        for _ in range(MOST_SADDLES):
            task = descents.task_at(solve, found)
            seen = self._stability.look(task)
            soft, history = _found_at(found, seen), whole.keeper.export()
            if seen.value > -FLAT:
                return _told(found, soft, stable=True if seen.known else None)
            # A kink may mislead the search, e.g. that of a cable that is just slack.
            if self._stability.curvature(task, seen.direction) > -FLAT:
                return _told(found, soft, stable=None)
            down = None if past(solve.problem.deadline) else self._stability.leave(task, seen.direction)
            if down is None or found.iterations >= solve.problem.limit:
                break
            whole.workspace.u[...] = down.unknowns
            slides, turns = whole.rigid_motion()
            solve.leave_to(found.state.with_(positions=down.positions, slides=slides, turns=turns))
            again = descents.descend(solve, whole, UpdateHistory.empty(), spent=found.iterations)
            spent = found.iterations + again.iterations
            if not (again.converged and again.min_det > 0.0):
                whole.keeper.load(history)
                return _told(changed(found, iterations=spent), soft, stable=False)
            found = changed(again, iterations=spent)
        return _told(found, soft, stable=False)


def _found_at(found: Solution, seen: Lowest) -> SoftDirection:
    """Return the direction that a search at a solution has found."""
    energy = found.state.summary.energy
    since = {"asked": 0, "asked_at": energy, "looked": 0, "looked_at": energy}
    return SoftDirection(direction=seen.direction, curvature=abs(seen.value), **since)


def _told(found: Solution, soft: SoftDirection | None, *, stable: bool | None) -> Solution:
    """Return a solution with its stability, and a message if it is unstable."""
    message = found.message if stable is not False else f"{UNSTABLE}; {found.message}".rstrip("; ")
    summary = changed(found.state.summary, stable=stable, message=message)
    return changed(found, state=found.state.with_(summary=summary, soft=soft))
