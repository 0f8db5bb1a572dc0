# SPDX-License-Identifier: Apache-2.0
"""Minimisation of the potential with the constant matrix, and the estimated distance to the equilibrium at its end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import Deadline, past
from gdfe_ros.solver.descent import pairs, quasi_newton
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.stopping import way_left
from gdfe_ros.solver.descent.workspace import WINDOW, End, Problem, Workspace, numbers
from gdfe_ros.solver.distance import largest_shift
from gdfe_ros.solver.matrix.coupling import Coupling, close_coupling
from gdfe_ros.solver.matrix.factor import Factorisation
from gdfe_ros.solver.state import State
from gdfe_ros.solver.tangent.level import TangentLevel
from gdfe_ros.solver.tangent.tangent import Tangent

SAFETY = 0.1
"""Assumed least ratio of the quasi-Newton step to the distance to the equilibrium. Slender bodies come close to it."""
FLOOR = 1e-9
"""A minimisation ends before its least number of iterations if its step, divided by the body's size, is at most this.
Shorter steps follow rounding errors, and could leave an unstable equilibrium.
"""
FARTHEST = 3000.0
"""A body counts as running away if a vertex' displacement, or a step, exceeds this multiple of the body's size."""
CHUNK = 20
"""Number of iterations with an explicit inverse between two checks of the deadline."""
_TEAM = threading.Lock()
"""Lock for numba's threads. They serve one caller at a time; a second one could crash the process."""
Observer = Callable[[float, float, bool], None]
"""Function of the minimised energy [J], the size of its terms [J], and whether the minimisation just begins."""


@dataclass(frozen=True, eq=False)
class Task:
    """The problem of a minimisation.

    Attributes:
        active: the unknowns, the elements and the workspace.
        problem: the constant data.
        coupling: couples the handles' rigid rows to the free vertices.
        deadline: once it has passed, the minimisation ends; None for no deadline.
        level: the kept tangent preconditioner; None for the constant matrix.
    """

    active: ActiveSet
    problem: Problem
    coupling: Coupling
    deadline: Deadline | None = None
    level: TangentLevel | None = None

    @property
    def turn(self) -> AbstractContextManager[object]:
        """The context manager for a call that may divide its work among threads: it holds the lock for threads."""
        return nullcontext() if self.problem.threads is None else _TEAM

    def evaluate(self) -> None:
        """Evaluate all terms at the present unknowns."""
        self.advance(0.0, first=True)

    def precondition(self, gradient: NDArray[np.float64], step: NDArray[np.float64]) -> None:
        """Write the product of the preconditioner H_0 and ``gradient`` (3 r,) [N] to ``step`` (3 r,) [m]."""
        if self.level is not None:
            self.level.solve(gradient, step)
            return
        matrix, rows = self.active.matrix, len(self.active.unknowns.free)
        matrix.solve(gradient.reshape(-1, 3)[:rows], step.reshape(-1, 3)[:rows])
        close_coupling(gradient, self.coupling, step)

    def advance(self, goal: float, *, first: bool = False) -> bool:
        """Make one iteration with the target ``goal`` [m]; return whether the minimisation has ended."""
        with self.turn:
            return quasi_newton.advance(self.problem, self.active.workspace, goal, first)


@dataclass(frozen=True)
class Descended:
    """Outcome of a minimisation.

    Attributes:
        iterations: number of iterations.
        cut: whether the limit of iterations or the deadline ended the minimisation before its target.
    """

    iterations: int
    cut: bool


class Minimiser:
    """Minimises the potential of a body.

    Args:
        body: the discretised body.
        weight, bending: (m,) [Pa] and (m,) [N/m] weights of the elements in the constant matrix (see `assemble`).

    Attributes:
        observer: function that receives the energy of every iteration; None for no observer.
        certified: whether conjugate gradients bound the distance to the equilibrium.
        lost: whether the solve was abandoned.
        remembers: whether the next solve starts with the history of this one.
    """

    certified, lost, remembers = False, False, True

    def __init__(self, body: Body, weight: NDArray[np.float64], bending: NDArray[np.float64]) -> None:
        self._body = body
        self._grain = float(np.finfo(float).eps * np.vdot(weight, body.shape.volume))
        self.observer: Observer | None = None

    def begin(self, active: ActiveSet, start: State, *, warm: bool) -> None:
        """Prepare a solve from ``start``. A solve that is not ``warm`` ends only after its steps shrink fast enough."""
        work, status = active.workspace, active.status
        status["reach"], status["grain"] = FARTHEST * self._body.size, self._grain
        status["seen"], work.recent[...] = -1 if warm else 0, 0.0
        status["ended"] = End.NONE

    def descend(self, task: Task, *, tolerance: float, final: float, least: int, limit: int) -> Descended:
        """Minimise until the step is short enough.

        If the start is not accurate enough, at least one iteration is made, even after the deadline.

        Args:
            task: the problem; its terms are evaluated at the present unknowns.
            tolerance: estimated largest distance to the equilibrium, divided by the body's size.
            final: tolerance of the whole solve; not used.
            least: least number of iterations.
            limit: largest number of iterations.
        """
        target = SAFETY * tolerance * self._body.size
        floor = min(target, FLOOR * self._body.size)
        ended = self._iterate(task, target, floor, least, limit, evaluate=True)
        used = ended.iterations
        if task.active.status["pending"]:
            pairs.take_products(task.active.workspace, None)
        return Descended(used, ended.cut)

    def error_estimate(self, active: ActiveSet) -> float:
        """Return the estimated largest distance to the equilibrium, divided by the body's size."""
        work, status, size = active.workspace, active.status, self._body.size
        distance = float(status["distance"]) / (SAFETY * size)
        if active.ended is not End.EXHAUSTED and status["seen"] >= 2 * WINDOW:
            distance = max(distance, float(way_left(work)) / size)
        return distance

    def spent_tangent(self) -> Tangent | None:
        """Return None: this minimiser has no tangent that the next solve can use."""
        return None

    def ran_away(self, active: ActiveSet) -> bool:
        """Return whether the body runs away, because the energy has no lower bound."""
        work = active.workspace
        far = not largest_shift(work.x, self._body.rest) <= FARTHEST * self._body.size
        return far or active.ended is End.RUNAWAY

    def _iterate(
        self, task: Task, target: float, floor: float, least: int, limit: int, *, evaluate: bool = False
    ) -> Descended:
        """Iterate with the constant matrix until the estimated distance to the equilibrium is below ``target`` [m].

        The first ``least`` iterations end only below the smaller distance ``floor`` [m]. With ``evaluate``, the terms
        are evaluated at the start first.
        """
        compiled = task.active.matrix.kind is not Factorisation.SCIPY
        later = compiled and limit > 0 and not self.observer  # the compiled iterations evaluate the terms as well
        if evaluate and not later:
            task.evaluate()
        if compiled:
            return self._run_constant(task, target, floor, least, limit, evaluate=evaluate and later)
        return self._run_stepwise(task, target, floor, least, limit)

    def _run_constant(
        self, task: Task, target: float, floor: float, least: int, limit: int, *, evaluate: bool
    ) -> Descended:
        """Iterate in compiled calls with the constant matrix's inverse: explicit, or a factor by supernodes."""
        dense = task.active.matrix.kind is Factorisation.DENSE
        unasked, chunk = (least, CHUNK) if dense else (0, 1)
        given = task.problem, task.active.workspace, task.coupling, floor

        def iterate(done: int, most: int) -> int:
            return quasi_newton.descend(*given, least - done, target, most, evaluate and done == 0)

        return self._run_compiled(task, iterate, limit, least=unasked, chunk=chunk)

    def _run_compiled(
        self, task: Task, iterate: Callable[[int, int], int], limit: int, *, least: int, chunk: int
    ) -> Descended:
        """Iterate in compiled calls.

        With a deadline, the first call makes ``least`` iterations, and each later call ``chunk`` iterations.
        ``iterate`` receives the number of iterations made so far and the number allowed. It returns the number of
        iterations that it made.
        """
        work, done = task.active.workspace, 0
        self._show(work, begins=True)
        while done < limit:
            most = limit - done
            if task.deadline:
                most = min(most, least - done if done < least else chunk)
            most = 1 if self.observer else most
            with task.turn:
                used = iterate(done, most)
            self._show(work, begins=False)
            done += used
            if used < most:
                return Descended(done, cut=False)
            if past(task.deadline):
                break
        return Descended(done, cut=True)

    def _run_stepwise(self, task: Task, target: float, floor: float, least: int, limit: int) -> Descended:
        """Iterate with a factor of the constant matrix that SciPy applies, in one compiled call for each iteration."""
        work = task.active.workspace
        self._show(work, begins=True)
        task.precondition(work.gradient, work.step)
        for iteration in range(limit):
            goal = target if iteration >= least else floor
            ended = task.advance(goal)
            self._show(work, begins=False)
            if ended:
                return Descended(iteration, cut=False)
            task.precondition(work.gradient, work.step)
            pairs.remember(work)
            if past(task.deadline):
                return Descended(iteration + 1, cut=True)
        return Descended(limit, cut=True)

    def _show(self, work: Workspace, *, begins: bool) -> None:
        if self.observer is not None:
            status = numbers(work)
            size = float(status["absolute"] + status["outside"]) + self._grain / quasi_newton.ROUNDING
            self.observer(float(status["energy"]), size, begins)
