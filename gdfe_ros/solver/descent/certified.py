# SPDX-License-Identifier: Apache-2.0
"""Descents on a kept tangent, which end when conjugate gradients on the present one say how far the equilibrium is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import past
from gdfe_ros.solver.descent import quasi_newton
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.minimiser import Descended, Minimiser, Task
from gdfe_ros.solver.descent.products import TangentProducts
from gdfe_ros.solver.descent.workspace import End
from gdfe_ros.solver.state import State
from gdfe_ros.solver.tangent.estimate import Estimate, estimate
from gdfe_ros.solver.tangent.level import Tangent, TangentLevel

TRUST = 5.0
"""Of the body's softness: a larger tolerance is replaced by it. Softness is, to a factor, the strain at which a slender
body buckles, and a shape that is off by that much in length is as much too stiff or too soft: there a small Newton step
says nothing."""
CONTRACTION = 0.5
"""Newton step over the last one from which on Newton steps are believed to tell the distance."""
NEAR = 0.1
"""Of the tolerance: a Newton step that is believed without another one before."""
SLACK = 5.0
"""Distance over the step that the kept tangent makes of a gradient."""
PATIENT = 12
"""Iterations in a row after which the tangent is taken anew."""
AWAY = 0.02
"""Of the body's size: a first step along a direction of negative curvature."""
MOST_UNKNOWN = 3
"""Times in a solve that conjugate gradients may leave the distance unknown: the body is about to buckle."""
MOST_TANGENTS = 20
"""Tangents in a solve after which it is given up: nothing smooth is found there, as where points of a cable meet."""
DAMPING = 10.0
"""Growth of the constant matrix's share, from the body's softness on, where steps do not shrink: a tangent that is
almost singular asks for steps that are far too long."""
FREE, WORTH = 6, 24
"""Iterations and products that a solve has free, and how many beyond them are worth a new tangent."""


class CertifiedMinimiser(Minimiser):
    """Descends in the potential of a body that is much softer in some motions than its constant matrix.

    Args:
        body: the discretised body.
        weight, bending: (m,) [Pa] and (m,) [N/m] of the constant matrix.
        level: the body's tangents.
        softness: stiffness of its softest motion over that of the constant matrix.
        trusting: the step that the kept tangent makes is believed: with inertia the body is nowhere near buckling.

    Attributes:
        tangent: that is kept.
        lost: the solve has given up: how far the equilibrium is cannot be known there.
    """

    def __init__(
        self,
        body: Body,
        weight: NDArray[np.float64],
        bending: NDArray[np.float64],
        level: TangentLevel,
        softness: float,
        *,
        trusting: bool = False,
    ) -> None:
        super().__init__(body, weight, bending)
        self.lumps, self.tangent = (), None
        self._level, self._softness, self._finest = level, softness, TRUST * softness
        self._product = TangentProducts(body)
        self._distance, self._work, self._prepared, self._trusting = np.inf, 0, False, trusting
        self.certified = not trusting
        self._patient, self._free, self._worth = PATIENT, FREE, WORTH
        if trusting:
            self._patient, self._free, self._worth = max(PATIENT, level.price), 0, max(WORTH, level.price)

    def begin(self, active: ActiveSet, start: State, *, warm: bool) -> None:
        """Begin a solve with the tangent of ``start``, to which its history belongs.

        A tangent that is due is taken at the last equilibrium where the solve is ``warm``, else where it begins.
        """
        super().begin(active, start, warm=True)
        self.tangent, self._last = start.tangent, start.positions if warm else None
        self._work, self._distance = 0, np.inf
        self.lost, self._unknown, self._tangents = False, 0, 0
        if self.tangent is not None:
            self._level.load(self.tangent)

    def descend(self, task: Task, *, tolerance: float, final: float, least: int, limit: int) -> Descended:
        """Descend until the step is short enough; at the ``final`` tolerance, until the distance is known to be.

        Args:
            task: what to descend in; its terms have been evaluated.
            tolerance: estimated largest distance to the equilibrium over the body's size.
            final: the tolerance of the whole solve.
            least: not needed.
            limit: most iterations.
        """
        target = min(tolerance, self._finest) * self._body.size
        known, self._prepared = self._distance <= target, False
        if self.tangent is None or self.tangent.spent >= self._worth:
            self._take(task, self._last)
        if known and self._still_near(task, target):
            return Descended(0, cut=False)
        if self._trusting:
            descended = self._run(task, target / SLACK, limit)
            self._distance = np.inf if descended.cut else SLACK * float(task.active.status["distance"])
        elif tolerance <= final:
            descended = self._certify(task, target, limit, known=known)
        else:
            descended = self._run(task, target, limit)
        if task.active.status["pending"]:
            quasi_newton.take_products(task.active.workspace)
        return descended

    def residual(self, active: ActiveSet) -> float:
        """Return the distance to the equilibrium over the body's size; infinite where it is not known."""
        return self._distance / self._body.size

    def spent_tangent(self) -> Tangent | None:
        """Return the tangent with the work of this solve."""
        if self.tangent is None:
            return None
        return replace(self.tangent, spent=self.tangent.spent + max(0, self._work - self._free))

    def _still_near(self, task: Task, target: float) -> bool:
        """Tell whether multipliers that were updated leave what was near its equilibrium within the target [m]."""
        work = task.active.workspace
        task.precondition(work.gradient, work.step)
        self._prepared = True
        left = SLACK * quasi_newton.largest(work.step)
        if left <= target:
            self._distance = max(left, self._distance)
        return left <= target

    def _certify(self, task: Task, target: float, limit: int, *, known: bool) -> Descended:
        """Descend until two Newton steps in a row, the second much shorter, tell that it is within ``target`` [m].

        Where the distance is ``known`` but for the last update of multipliers, one such step is enough.
        """
        status, used = task.active.status, 0
        nothing = NEAR * target / CONTRACTION
        before = np.inf if known else nothing
        while True:
            went = self._run(task, target, limit - used)
            used += went.iterations
            if went.cut or self.lost or status["ended"] == End.RUNAWAY:
                return Descended(used, went.cut)
            found = self._ask(task, target)
            self._distance = found.distance
            if found.known and found.distance <= min(target, CONTRACTION * before):
                return Descended(used, cut=False)
            if used >= limit or (used > 0 and past(task.deadline)):
                return Descended(used, cut=True)
            self._unknown += not found.known
            if self._unknown > MOST_UNKNOWN:
                self.lost = True
                return Descended(used, cut=False)
            if found.definite and not found.known:
                self._take(task)
                continue
            step = found.step if found.known else self._away(found.step)
            if not self._follow(task, step):
                return Descended(used, cut=False)
            used, before = used + 1, max(before, found.distance) if found.known else nothing

    def _run(self, task: Task, goal: float, limit: int) -> Descended:
        """Iterate until the step is at most ``goal`` [m]; take the tangent anew where that takes long."""
        used, damping, before, status = 0, 0.0, np.inf, task.active.status
        while True:
            chunk = min(self._patient, limit - used)
            went = self._run_stepwise(task, goal, goal, 0, chunk, prepared=self._prepared)
            self._prepared = True
            used, self._work = used + went.iterations, self._work + went.iterations
            # An almost singular tangent asks for a step beyond all reach; the energy need not be unbounded for that.
            astray = status["ended"] == End.RUNAWAY and status["blocked"] == 0
            if not (went.cut or astray) or used >= limit or past(task.deadline):
                return Descended(used, went.cut)
            self._tangents += 1
            if self._tangents > MOST_TANGENTS:
                self.lost = True
                return Descended(used, cut=False)
            if astray or status["distance"] > 0.5 * before:
                damping = max(self._softness, DAMPING * damping)
            before = float(status["distance"])
            self._take(task, damping=damping)

    def _take(self, task: Task, x: NDArray[np.float64] | None = None, *, damping: float = 0.0) -> None:
        work = task.active.workspace
        self.tangent = self._level.take(task.problem, work.u, work.x if x is None else x, damping=damping)
        status, self._work = task.active.status, 0
        status["count"], status["pending"], status["ended"], self._prepared = 0, 0, End.NONE, False

    def _ask(self, task: Task, target: float) -> Estimate:
        self._product.begin(task)
        work = task.active.workspace
        found = estimate(self._product, work.gradient, work.step, self._level.solve, target)
        self._work += found.products
        return found

    def _away(self, direction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a step along a direction (3 r,) of negative curvature that is long enough to leave it."""
        return AWAY * self._body.size / quasi_newton.largest(direction) * direction

    def _follow(self, task: Task, step: NDArray[np.float64]) -> bool:
        """Search along a step (3 r,); tell whether it leads down."""
        work, status = task.active.workspace, task.active.status
        if status["pending"]:
            quasi_newton.take_products(work)
        status["slope"], status["distance"] = float(work.gradient @ step), quasi_newton.largest(step)
        if not status["slope"] < 0.0:
            return False
        work.direction[...], status["given"], status["ended"] = step, 1, End.NONE
        if task.advance(0.0):
            return False
        task.precondition(work.gradient, work.step)
        quasi_newton.remember(work)
        self._work, self._prepared = self._work + 1, True
        return True
