# SPDX-License-Identifier: Apache-2.0
"""Descents to a step that is short enough, and how far from the equilibrium they end."""

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
from gdfe_ros.solver.descent.lumps import find_lumps, largest_turn
from gdfe_ros.solver.descent.stopping import way_left
from gdfe_ros.solver.descent.workspace import WINDOW, End, Problem, Workspace, numbers
from gdfe_ros.solver.distance import largest_shift
from gdfe_ros.solver.matrix.coupling import Coupling, close_coupling
from gdfe_ros.solver.matrix.factor import Factorisation
from gdfe_ros.solver.state import State
from gdfe_ros.solver.tangent.level import Tangent, TangentLevel

SAFETY = 0.1
"""The quasi-Newton step falls short of the distance to the equilibrium by up to this factor on slender bodies."""
PATIENT_ITERATIONS = 20
"""Iterations before the moments of hard lumps are looked at again."""
LEARNED = 2
"""Iterations over the pairs of a history after which one that was begun anew knows the softest modes."""
FLOOR = 1e-3
"""Share of the tolerance at which even the least iterations are left out."""
LEAST_FLOOR = 1e-9
"""Of the body's size: below, iterations follow rounding, and leave an unstable equilibrium for it."""
FARTHEST = 3000.0
"""Of the body's size: where a vertex or a step goes farther, the body runs away."""
CHUNK = 20
"""Iterations with an explicit inverse between two looks at the clock."""
_TEAM = threading.Lock()
"""Numba's threads serve one caller at a time: the simplest of its threading layers ends the process otherwise."""
Observer = Callable[[float, float, bool], None]
"""Takes the energy [J] that a descent lowers, the size of its terms [J], and whether the descent only begins there."""


@dataclass(frozen=True, eq=False)
class Task:
    """What a solve descends in.

    Attributes:
        active: what moves, and the workspace.
        problem: what stays constant.
        coupling: how the handles' rigid rows hang on the free vertices.
        deadline: when it has passed, a descent ends; None: never.
        level: the kept tangent that preconditions; None for the constant matrix.
    """

    active: ActiveSet
    problem: Problem
    coupling: Coupling
    deadline: Deadline | None = None
    level: TangentLevel | None = None

    @property
    def turn(self) -> AbstractContextManager[object]:
        """What is entered around a call that may share its work among threads."""
        return nullcontext() if self.problem.threads is None else _TEAM

    def evaluate(self) -> None:
        """Evaluate all terms where the unknowns are."""
        self.advance(0.0, first=True)

    def precondition(self, gradient: NDArray[np.float64], step: NDArray[np.float64]) -> None:
        """Write H_0 gradient (3 r,) to ``step`` (3 r,)."""
        if self.level is not None:
            self.level.solve(gradient, step)
            return
        matrix, rows = self.active.matrix, len(self.active.unknowns.free)
        matrix.solve(gradient.reshape(-1, 3)[:rows], step.reshape(-1, 3)[:rows])
        close_coupling(gradient, self.coupling, step)

    def advance(self, goal: float, *, first: bool = False) -> bool:
        """Do one iteration towards a step of at most ``goal`` [m]; see `quasi_newton.advance`."""
        with self.turn:
            return quasi_newton.advance(self.problem, self.active.workspace, goal, first)


@dataclass(frozen=True)
class Descended:
    """How a descent went.

    Attributes:
        iterations: that were made.
        cut: the limit or the deadline ended it, not its goal.
    """

    iterations: int
    cut: bool


class Minimiser:
    """Descends in the potential of a body.

    Args:
        body: the discretised body.
        weight, bending: (m,) [Pa] and (m,) [N/m] of the constant matrix.

    Attributes:
        observer: sees the energy of every iteration; None for nobody.
        lumps: hard pieces in a soft body, whose turns the constant matrix takes for stiff.
        certified: what it calls the residual is known by conjugate gradients.
        lost: the solve has given up.
    """

    certified, lost = False, False

    def __init__(self, body: Body, weight: NDArray[np.float64], bending: NDArray[np.float64]) -> None:
        self._body = body
        self._grain = float(np.finfo(float).eps * np.vdot(weight, body.shape.volume))
        self.lumps = find_lumps(body, weight, bending)
        self.observer: Observer | None = None

    def begin(self, active: ActiveSet, start: State, *, warm: bool) -> None:
        """Begin a solve from ``start``; where it is not ``warm``, it ends only when its steps have shrunk."""
        work, status = active.workspace, active.status
        status["reach"], status["grain"] = FARTHEST * self._body.size, self._grain
        status["seen"], work.recent[...] = -1 if warm else 0, 0.0
        status["ended"] = End.NONE
        self._unlearned = False

    def descend(self, task: Task, *, tolerance: float, final: float, least: int, limit: int) -> Descended:
        """Descend until the step is short enough and no hard lump lags behind.

        At least one iteration is made, whatever the deadline, unless none is needed.

        Args:
            task: what to descend in; its terms are evaluated where the unknowns are.
            tolerance: estimated largest distance to the equilibrium over the body's size.
            final: the tolerance of the whole solve; what is below a small share of it needs no iteration at all.
            least: iterations to make at least.
            limit: most iterations.
        """
        target = SAFETY * tolerance * self._body.size
        floor = min(target, max(FLOOR * SAFETY * final, LEAST_FLOOR) * self._body.size)
        ended = self._iterate(task, target, floor, least, limit, evaluate=True)
        used = ended.iterations
        if self._misled(task, target) and used < limit and not past(task.deadline):
            self._unlearned, least = True, LEARNED * len(task.active.workspace.row)
            ended = self._iterate(task, target, floor, least, limit - used, evaluate=True)
            used += ended.iterations
        while not ended.cut and self._lag(task.active) > tolerance and used < limit and not past(task.deadline):
            ended = self._iterate(task, target, floor, PATIENT_ITERATIONS, limit - used)
            used += ended.iterations
            if not ended.iterations or task.active.ended is not End.NONE:
                break
        if task.active.status["pending"]:
            pairs.take_products(task.active.workspace, None)
        return Descended(used, ended.cut)

    def residual(self, active: ActiveSet) -> float:
        """Return the estimated largest distance to the equilibrium over the body's size."""
        work, status, size = active.workspace, active.status, self._body.size
        distance = float(status["distance"]) / (SAFETY * size)
        if active.ended is not End.EXHAUSTED and status["seen"] >= 2 * WINDOW:
            distance = max(distance, float(way_left(work)) / size)
        return max(distance, self._lag(active))

    def spent_tangent(self) -> Tangent | None:
        """Return the tangent that the next solve begins with: none."""
        return None

    def ran_away(self, active: ActiveSet) -> bool:
        """Tell whether the energy has no lower bound."""
        work = active.workspace
        far = not largest_shift(work.x, self._body.rest) <= FARTHEST * self._body.size
        return far or active.ended is End.RUNAWAY

    def _misled(self, task: Task, target: float) -> bool:
        """Tell whether a descent ended short of its target [m] with a history that may be made of rounding."""
        short = task.active.ended is End.EXHAUSTED and float(task.active.status["distance"]) > target
        return short and not self._unlearned

    def _iterate(
        self, task: Task, target: float, floor: float, least: int, limit: int, *, evaluate: bool = False
    ) -> Descended:
        """Iterate with the constant matrix, from where the terms are evaluated or, where asked, are to be first.

        At the first ``least`` iterations only the ``floor`` ends it.
        """
        compiled = task.active.matrix.kind is not Factorisation.SCIPY
        later = compiled and limit > 0 and not self.observer  # the compiled iterations evaluate them, too
        if evaluate and not later:
            task.evaluate()
        if compiled:
            return self._run_constant(task, target, floor, least, limit, evaluate=evaluate and later)
        return self._run_stepwise(task, target, floor, least, limit)

    def _run_constant(
        self, task: Task, target: float, floor: float, least: int, limit: int, *, evaluate: bool
    ) -> Descended:
        """Iterate with the constant matrix's inverse, explicit or by supernodes."""
        dense = task.active.matrix.kind is Factorisation.DENSE
        unasked, chunk = (least, CHUNK) if dense else (0, 1)
        given = task.problem, task.active.workspace, task.coupling, floor

        def iterate(done: int, most: int) -> int:
            return quasi_newton.descend(*given, least - done, target, most, evaluate and done == 0)

        return self._run_compiled(task, iterate, limit, least=unasked, chunk=chunk)

    def _run_kept(self, task: Task, target: float, limit: int, *, prepared: bool) -> Descended:
        """Iterate with a kept tangent; where it is ``prepared``, the first step is preconditioned."""
        work = task.active.workspace
        if not prepared:
            task.precondition(work.gradient, work.step)

        def iterate(done: int, most: int) -> int:
            return quasi_newton.descend_kept(task.problem, work, task.level.kept, target, most)

        return self._run_compiled(task, iterate, limit, least=0, chunk=1)

    def _run_compiled(
        self, task: Task, iterate: Callable[[int, int], int], limit: int, *, least: int, chunk: int
    ) -> Descended:
        """Iterate many times in one compiled call; where there is a deadline, ``least`` times, and ``chunk`` at once.

        ``iterate`` is told how many iterations were made and how many it may make, and returns how many it made.
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

    def _run_stepwise(
        self, task: Task, target: float, floor: float, least: int, limit: int, *, prepared: bool = False
    ) -> Descended:
        """Iterate with a factor that a library applies; where it is ``prepared``, the first step is preconditioned."""
        work = task.active.workspace
        self._show(work, begins=True)
        if not prepared:
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

    def _lag(self, active: ActiveSet) -> float:
        """Return by how much a hard lump has yet to turn, over the body's size."""
        if not self.lumps:
            return 0.0
        work, free = active.workspace, active.unknowns.free
        gradient = np.zeros_like(work.x)
        gradient[free] = work.gradient.reshape(-1, 3)[: len(free)]
        return largest_turn(self.lumps, work.x, gradient) / self._body.size
