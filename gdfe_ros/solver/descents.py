# SPDX-License-Identifier: Apache-2.0
"""Descents to a step that is short enough, and how far from the equilibrium they end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.external import External
from gdfe_ros.solver import descent as entries
from gdfe_ros.solver import quasi_newton
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import Deadline, past
from gdfe_ros.solver.descent import Descent, Problem
from gdfe_ros.solver.global_matrix import Factorisation, close_coupling
from gdfe_ros.solver.inclusions import find_lumps, largest_turn
from gdfe_ros.solver.scope import Scope
from gdfe_ros.solver.stopping import way_left

SAFETY = 0.1
"""The quasi-Newton step falls short of the distance to the equilibrium by up to this factor on slender bodies."""
PATIENT_ITERATIONS = 20
"""Iterations before the moments of hard lumps are looked at again."""
FLOOR = 1e-3
"""Share of the tolerance at which even the least iterations are left out."""
FARTHEST = 3000.0
"""Of the body's size: where a vertex or a step goes farther, the body runs away."""
CHUNK = 20
TERMS = [entries.ENERGY, entries.ABSOLUTE, entries.OUTSIDE]
_TEAM = threading.Lock()
"""Numba's threads serve one caller at a time: the simplest of its threading layers ends the process otherwise."""
Observer = Callable[[float, float, bool], None]
"""Takes the energy [J] that a descent lowers, the size of its terms [J], and whether the descent only begins there."""


@dataclass(frozen=True, eq=False)
class Task:
    """What a solve descends in.

    Attributes:
        scope: what moves.
        problem: elements and plates.
        external: loads and actuators; None compiles and costs nothing.
        deadline: when it has passed, a descent ends; None: never.
    """

    scope: Scope
    problem: Problem
    external: External | None
    deadline: Deadline | None = None

    def evaluate(self) -> None:
        """Evaluate the elements where the unknowns are."""
        self.advance(0.0, first=True)

    def advance(self, goal: float, *, first: bool = False) -> bool:
        """Do one iteration towards a step of at most ``goal`` [m]; see `quasi_newton.advance`."""
        with nullcontext() if self.problem.threads is None else _TEAM:
            return quasi_newton.advance(self.problem, self.external, self.scope.descent, goal, first)


class Descents:
    """Descents of a body, in whatever scope.

    Args:
        body: the discretised body.
        weight, bending: (m,) [Pa] and (m,) [N/m] of the constant matrix.

    Attributes:
        observer: sees the energy of every iteration; None for nobody.
        lumps: hard pieces in a soft body, whose turns the constant matrix takes for stiff.
    """

    def __init__(self, body: Body, weight: NDArray[np.float64], bending: NDArray[np.float64]) -> None:
        self._body = body
        self._grain = float(np.finfo(float).eps * np.vdot(weight, body.shape.volume))
        self.lumps = find_lumps(body, weight, bending)
        self.observer: Observer | None = None

    def begin(self, scope: Scope, *, watched: bool) -> None:
        """Begin a solve; with ``watched`` it ends only when its steps have shrunk."""
        status = scope.descent.status
        status[[entries.REACH, entries.GRAIN]] = FARTHEST * self._body.size, self._grain
        status[entries.SEEN] = 0.0 if watched else -1.0

    def descend(self, task: Task, *, tolerance: float, least: int, limit: int) -> int:
        """Descend until the step is short enough and no hard lump lags behind.

        Args:
            task: what to descend in; its elements have been evaluated.
            tolerance: estimated largest distance to the equilibrium over the body's size.
            least: iterations to make at least.
            limit: most iterations.

        Returns:
            The iterations made.
        """
        target, scope = SAFETY * tolerance * self._body.size, task.scope
        run = self._run_dense if scope.matrix.kind is Factorisation.DENSE else self._run_sparse
        used = run(task, target, least, limit)
        while self._lag(scope) > tolerance and used < limit and not past(task.deadline):
            more = run(task, target, PATIENT_ITERATIONS, limit - used)
            used += more
            if not more or scope.descent.status[entries.STALLED]:
                break
        return used

    def residual(self, scope: Scope) -> float:
        """Return the estimated largest distance to the equilibrium over the body's size."""
        descent, size = scope.descent, self._body.size
        distance = float(descent.status[entries.DISTANCE]) / (SAFETY * size)
        if descent.status[entries.STALLED] != entries.EXHAUSTED:
            distance = max(distance, float(way_left(descent)) / size)
        return max(distance, self._lag(scope))

    def ran_away(self, scope: Scope) -> bool:
        """Tell whether the energy has no lower bound."""
        far = not np.abs(scope.descent.x - self._body.rest).max() <= FARTHEST * self._body.size
        return bool(far or scope.descent.status[entries.STALLED] == entries.RUNAWAY)

    def _run_dense(self, task: Task, target: float, least: int, limit: int) -> int:
        """Iterate with the explicit inverse, many iterations in one compiled call."""
        descent, coupling, done = task.scope.descent, task.scope.matrix.coupling, 0
        self._show(descent, begins=True)
        while done < limit:
            chunk = min(least - done if done < least else CHUNK if task.deadline else limit, limit - done)
            chunk = 1 if self.observer else chunk
            goal = FLOOR * target if done < least else target
            used = quasi_newton.descend(task.problem, task.external, descent, coupling, goal, chunk)
            self._show(descent, begins=False)
            done += used
            if used < chunk or past(task.deadline):
                break
        return done

    def _run_sparse(self, task: Task, target: float, least: int, limit: int) -> int:
        """Iterate with a library's factor."""
        descent, matrix, rows = task.scope.descent, task.scope.matrix, len(task.scope.unknowns.free)
        free_gradient, free_step = descent.gradient.reshape(-1, 3)[:rows], descent.step.reshape(-1, 3)[:rows]
        self._show(descent, begins=True)
        matrix.solve(free_gradient, free_step)
        close_coupling(descent.gradient, matrix.coupling, descent.step)
        for iteration in range(limit):
            goal = target if iteration >= least else FLOOR * target
            ended = task.advance(goal)
            self._show(descent, begins=False)
            if ended or past(task.deadline):
                return iteration
            matrix.solve(free_gradient, free_step)
            close_coupling(descent.gradient, matrix.coupling, descent.step)
            quasi_newton.remember(descent)
        return limit

    def _show(self, descent: Descent, *, begins: bool) -> None:
        if self.observer is not None:
            energy, inside, outside = descent.status[TERMS]
            self.observer(energy, inside + outside + self._grain / quasi_newton.ROUNDING, begins)

    def _lag(self, scope: Scope) -> float:
        """Return by how much a hard lump has yet to turn, over the body's size."""
        if not self.lumps:
            return 0.0
        free, gradient = self._body.unknowns.free, np.zeros_like(scope.descent.x)
        gradient[free] = scope.descent.gradient.reshape(-1, 3)[: len(free)]
        return largest_turn(self.lumps, scope.descent.x, gradient) / self._body.size
