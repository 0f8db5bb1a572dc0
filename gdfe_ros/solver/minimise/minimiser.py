# SPDX-License-Identifier: Apache-2.0
"""Minimisation of the potential: the compiled loop, deadlines, and the tangents that precondition it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact_forces import ContactForces
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.arc import follow_arc_once
from gdfe_ros.solver.descent.lbfgs_workspace import Problem, Workspace
from gdfe_ros.solver.descent.loop import ENDLESS, Metric, descend, precondition
from gdfe_ros.solver.descent.search import ENERGY_ROUNDING, advance
from gdfe_ros.solver.matrix.substitution import Kept
from gdfe_ros.solver.matrix.tangent_assembly import Tangent
from gdfe_ros.solver.minimise.level import TangentLevel
from gdfe_ros.solver.outcome import Deadline, Outcome, past
from gdfe_ros.solver.vectors import Array, largest, largest_distance

_TEAM = threading.Lock()
"""Lock for numba's threads. They serve one caller at a time; a second caller could crash the process."""
Observer = Callable[[float, float, bool], None]
"""Function that receives the energy [J], the sum of the magnitudes of its terms [J], and whether a minimisation begins.
"""


@dataclass(frozen=True, eq=False)
class Task:
    """The problem of a minimisation.

    Attributes:
        active: the unknowns, the elements and the workspace.
        problem: the constant data.
        deadline: once it has passed, the minimisation ends; None for no deadline.
        runs_away: function that is called with positions (n, 3) [m] at which the tangent is indefinite, and returns
            whether to end the minimisation; None to continue in any case.
    """

    active: ActiveSet
    problem: Problem
    deadline: Deadline | None = None
    runs_away: Callable[[Array], bool] | None = None

    @property
    def turn(self) -> AbstractContextManager[object]:
        """The context manager for a call that may use several threads; it takes the lock of numba's threads."""
        return nullcontext() if self.problem.threads is None else _TEAM

    def evaluate(self) -> None:
        """Evaluate all terms at the present unknowns."""
        with self.turn:
            advance(self.problem, self.active.workspace, True)


class Minimiser:
    """Minimises the potential of a body.

    Args:
        body: the discretised body.
        weight: (m,) [Pa] weights of the elements in the constant matrix (see `assemble`).
        level: the body's tangent preconditioner.
        moving: whether inertia is among the terms.
        contact_forces: finder of the contact forces in each step of a minimisation; None without contact.

    Attributes:
        level: the argument.
        observer: function that receives the energy of every iteration; None for no observer.
        rest: the tangent of the undeformed body; None if it is too expensive, or if the body is a mechanism.
        tangent: the tangent in use; None if the constant matrix is in use.
    """

    SHARE, MOVING, FREE = 0.2, 0.1, 0.02
    """A minimisation ends if its distance to the equilibrium, divided by the tolerance, is at most this: in statics, in
    motion, and in the motion of free bodies, whose momentum only the accuracy of the solve conserves.
    """
    TRUST = 0.1
    """Assumed least ratio of the length of a step with the constant matrix to the distance to the equilibrium."""
    FARTHEST = 3000.0
    """A body counts as running away if a vertex moves by more than this multiple of the body's size in a solve."""
    LEAST_AGE, AGE = 24, 1.5
    """Within a solve, a tangent is renewed after the larger of two numbers of iterations: the first number, and the
    second number times `TangentLevel.price`. The first number prevents renewals after every few long steps.
    """
    UNSOLVED = 1000
    """If the tangent of a body is expensive, it is evaluated only after this number of iterations of a solve, because a
    solution with its factor takes many times as long as with the constant matrix.
    """

    def __init__(
        self,
        body: Body,
        weight: Array,
        level: TangentLevel,
        *,
        moving: bool,
        contact_forces: ContactForces | None = None,
    ) -> None:
        self._body, self.level, self.contact_forces = body, level, contact_forces
        held = bool(body.handles) and not body.rigid_bodies
        self._share = (self.MOVING if held else self.FREE) if moving else self.SHARE
        self._grain = float(np.finfo(float).eps * np.vdot(weight, body.shape.volume))
        rows, (count, corners) = 3 * body.unknowns.rows, body.cells.shape
        scratch = np.zeros(rows), np.zeros(rows), body.rest.copy(), np.zeros((count, corners, 3))
        self._given = weight, *scratch, np.empty((len(body.rest), 9))
        self._none = Kept.none()
        self.observer: Observer | None = None
        self.tangent: Tangent | None = None
        self.rest: Tangent | None = None

    def begin(self, active: ActiveSet, tangent: Tangent | None) -> None:
        """Prepare a solve that uses ``tangent``; None stands for the tangent of the undeformed body."""
        status = active.status
        status["reach"], status["grain"] = self.FARTHEST * self._body.size, self._grain
        status["count"], status["head"], status["since"], status["turned"], status["wild"] = 0, 0, 0, np.inf, 0
        self._spent = 0
        if self.contact_forces is not None:
            self.contact_forces.begin()
        self.tangent = tangent or self.rest
        if self.tangent is not None:
            self.level.load(self.tangent)

    def descend(self, task: Task, *, tolerance: float, limit: int, proven: bool = False) -> int:
        """Minimise until the estimated distance to the equilibrium is small enough for the tolerance.

        Return the number of iterations; ``task.active.ended`` is the reason for the end.

        Args:
            task: the problem.
            tolerance: allowed distance, divided by the body's size.
            limit: largest number of iterations.
            proven: whether the last minimisation has reached the equilibrium. Updates may have moved the equilibrium
                since.
        """
        work, begins, done = task.active.workspace, True, 0
        target = self._share * tolerance * self._body.size
        self._follow_terms(task)
        while True:
            chunk = 1 if self.observer or task.deadline else limit
            if begins and self.observer:
                task.evaluate()
                self._show(work, begins=True)
            with task.turn:
                metric, minimum = self.metric(task.active), (self._body.size, target, proven, self._age())
                least = max(0, min(chunk, limit - done))
                if self.contact_forces:
                    used = self._touching(task, metric, minimum, least, begins=begins)
                else:
                    used = descend(task.problem, work, metric, *minimum, least, begins)
            self._show(work, begins=False)
            begins, done = False, done + used
            self._spent += used
            if task.active.ended is Outcome.WORN and self._renew_tangent(task, fresh=not used):
                continue
            if task.active.ended is Outcome.NONE and (done >= limit or past(task.deadline)):
                task.active.status["ended"] = Outcome.CUT
            if task.active.ended is not Outcome.NONE:
                return done

    def _follow_terms(self, task: Task) -> None:
        """Evaluate a new tangent if the stage of a term has changed; otherwise update the springs of the old one."""
        work = task.active.workspace
        if self.level.is_outdated(self.tangent) and (self.tangent is not None or self.level.fits):
            self._adopt(task, self.level.factor_tangent(task.problem, work.u, work.x))
        elif self.tangent is not None:
            self.tangent = self.level.reconnect(self.tangent, work.x)

    def _touching(
        self, task: Task, metric: Metric, minimum: tuple[float, float, bool, int], limit: int, *, begins: bool
    ) -> int:
        """Do `descend` with contact: each step includes contact forces that satisfy the laws of contact."""
        problem, work = task.problem, task.active.workspace
        key = (None,) if self.tangent is None else (self.tangent.blocks, self.tangent.springs)
        show = partial(self._show, work, begins=True) if self.observer else None  # other forces have another energy
        return self.contact_forces.descend(problem, work, metric, key, minimum, limit, show, begins=begins)

    def precondition(self, task: Task, gradient: Array, step: Array) -> None:
        """Write the product of M^-1 and ``gradient`` (3 r,) [N] to ``step`` (3 r,) [m]."""
        precondition(self.metric(task.active), gradient[None], step[None])

    def follow_arc(self, task: Task, step: Array) -> Array:
        """Return the step (3 r,) [m] to the end of the arc that begins with ``step``, shortened as in `arc`."""
        work = task.active.workspace
        work.direction[...] = step
        follow_arc_once(task.problem, work, self.metric(task.active))
        return work.direction + work.curve

    def renew(self, task: Task) -> bool:
        """Use the tangent at the present unknowns of ``task`` if it is positive definite; return whether it is.

        Otherwise the old tangent stays in use: the tangent at a saddle, made definite, is a poor preconditioner for
        steps away from the saddle.
        """
        if self.tangent is None and not self.level.affordable:
            return False
        before, work = self.tangent, task.active.workspace
        taken = self.level.factor_tangent(task.problem, work.u, work.x, definite=True)
        if taken is None:
            if before is not None:
                self.level.load(before)
                self.level.turn(work.x)
                self.tangent = replace(before, spent=0, solves=0, latest=0)
            return False
        self._adopt(task, taken)
        return True

    def _adopt(self, task: Task, tangent: Tangent) -> None:
        status = task.active.status
        self.tangent = tangent
        status["count"], status["since"], status["turned"], status["before"] = 0, 0, np.inf, np.inf
        status["ended"], self._spent = Outcome.NONE, 0

    def newton_step(self, task: Task) -> tuple[float, Array]:
        """Return the estimated distance to the equilibrium, divided by the body's size, and the step M^-1 g (3 r,) [m].

        The estimate is the largest displacement in the step. With a fresh tangent M it is accurate. With the constant
        matrix, it is divided by `TRUST`.
        """
        step, trust = np.empty_like(task.active.workspace.u), 1.0 if self.tangent is not None else self.TRUST
        self.precondition(task, task.active.workspace.gradient, step)
        return float(largest(step)) / (trust * self._body.size), step

    def error_estimate(self, active: ActiveSet) -> float:
        """Return the estimated largest distance to the equilibrium, divided by the body's size."""
        return float(active.status["distance"]) / self._body.size

    def keep_tangent(self) -> Tangent | None:
        """Return the tangent for the next solve, with the cost of this solve added; None if there is none."""
        if self.tangent is None:
            return None
        tangent, spent = self.tangent, self._spent
        return replace(tangent, spent=tangent.spent + spent, solves=tangent.solves + 1, latest=spent)

    def is_overdue(self, tangent: Tangent | None) -> bool:
        """Return whether a new tangent lowers the mean cost of a solve."""
        return tangent is not None and tangent.overdue(max(self.LEAST_AGE // 2, self.level.price))

    def ran_away(self, active: ActiveSet, since: Array) -> bool:
        """Return whether the body has run away from ``since`` (n, 3) [m], because the energy has no lower bound."""
        far = not largest_distance(active.workspace.x, since) <= self.FARTHEST * self._body.size
        return far or active.ended is Outcome.RUNAWAY

    def metric(self, active: ActiveSet) -> Metric:
        """Return the initial matrix for the kernels."""
        held, tangent, coupling = bool(self._body.handles), self.tangent, active.matrix.coupling
        if tangent is None:
            return Metric(self._none, coupling, self._body.rest, held, self.TRUST, *self._given)
        before = self._body.rest if tangent.positions is None else tangent.positions
        return Metric(self.level.kept, coupling, before, held, 1.0, *self._given)

    def _age(self) -> int:
        """Return the number of iterations in a solve after which the matrix is renewed."""
        if self.tangent is None:
            return self.UNSOLVED if self.level.fits else ENDLESS
        return max(self.LEAST_AGE, round(self.AGE * self.level.price))

    def _renew_tangent(self, task: Task, *, fresh: bool) -> bool:
        """Renew the tangent within a solve; return whether that is possible and may help."""
        if fresh and task.active.status["since"] == 0:
            return False
        if self.tangent is None and not self.level.fits:
            return False
        work = task.active.workspace
        self._adopt(task, self.level.factor_tangent(task.problem, work.u, work.x))
        if self.tangent.shift > 0.0 and task.runs_away is not None and task.runs_away(work.x):
            task.active.status["ended"] = Outcome.GIVEN_UP
            return False
        return True

    def _show(self, work: Workspace, *, begins: bool) -> None:
        if self.observer is not None:
            status = work.status[0]
            size = float(status["absolute"] + status["outside"]) + self._grain / ENERGY_ROUNDING
            self.observer(float(status["energy"]), size, begins)
