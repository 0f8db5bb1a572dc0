# SPDX-License-Identifier: Apache-2.0
"""Descents on a kept tangent: L-BFGS whose first matrix is the stiffness at a recent shape, taken anew when it pays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import past
from gdfe_ros.solver.descent import pairs
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.minimiser import Descended, Minimiser, Task
from gdfe_ros.solver.descent.workspace import End
from gdfe_ros.solver.distance import largest
from gdfe_ros.solver.state import State
from gdfe_ros.solver.tangent.level import Tangent, TangentLevel

TRUST = 5.0
"""Of the body's softness: a larger tolerance is replaced by it. Softness is, to a factor, the strain at which a slender
body buckles, and a shape that is off by that much in length is as much too stiff or too soft: there a small Newton step
says nothing."""
SLACK = 5.0
"""Distance over the step that the kept tangent makes of a gradient."""
PATIENT = 12
"""Iterations in a row after which the tangent is taken anew."""
MOST_TANGENTS = 20
"""Tangents in a solve after which it is given up: nothing smooth is found there, as where points of a cable meet."""
DAMPING = 10.0
"""Growth of the constant matrix's share, from the body's softness on, where steps do not shrink: a tangent that is
almost singular asks for steps that are far too long."""
WORTH = 24
"""Iterations and products, beyond those that a solve has free, that are worth a new tangent."""


class TangentMinimiser(Minimiser):
    """Descends in the potential of a body that is much softer in some motions than its constant matrix.

    The step that the kept tangent makes is believed to tell the distance, as it does in motion: with inertia a body is
    nowhere near buckling. A tangent is taken anew when the iterations with it have cost as much as it did.

    Args:
        body: the discretised body.
        weight, bending: (m,) [Pa] and (m,) [N/m] of the constant matrix.
        level: the body's tangents.
        softness: stiffness of its softest motion over that of the constant matrix.

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
    ) -> None:
        super().__init__(body, weight, bending)
        self.lumps, self.tangent = (), None
        self._level, self._softness, self._finest = level, softness, TRUST * softness
        self._distance, self._shortfall = np.inf, 1.0
        self._work, self._prepared = 0, False
        self._patient, self._free, self._worth = max(PATIENT, level.price), 0, max(WORTH, level.price)

    def begin(self, active: ActiveSet, start: State, *, warm: bool) -> None:
        """Begin a solve with the tangent of ``start``, to which its history belongs.

        A tangent that is due is taken at the last equilibrium where the solve is ``warm``, else where it begins.
        """
        super().begin(active, start, warm=True)
        self.tangent, self._last = start.tangent, start.positions if warm else None
        self._work, self._distance, self._shortfall = 0, np.inf, 1.0
        self.lost, self._tangents = False, 0
        if self.tangent is not None:
            self._level.load(self.tangent)

    def descend(self, task: Task, *, tolerance: float, final: float, least: int, limit: int) -> Descended:
        """Descend until the distance is within the tolerance.

        Args:
            task: what to descend in; its terms are evaluated where the unknowns are.
            tolerance: estimated largest distance to the equilibrium over the body's size.
            final: the tolerance of the whole solve.
            least: not needed.
            limit: most iterations.
        """
        task.evaluate()
        target = min(tolerance, self._finest) * self._body.size
        known, self._prepared = self._distance <= target, False
        if self.tangent is None or self.tangent.spent >= self._worth:
            self._take(task, self._last)
        elif self._level.touched(task.active.workspace.x):
            self._tangents += 1
            self._take(task)
            self.lost = self._tangents > MOST_TANGENTS
        if known and self._still_near(task, target):
            return Descended(0, cut=False)
        descended = self._approach(task, target, limit, known=known, last=tolerance <= final)
        if task.active.status["pending"]:
            pairs.take_products(task.active.workspace, None)
        return descended

    def residual(self, active: ActiveSet) -> float:
        """Return the distance to the equilibrium over the body's size; infinite where it is not known."""
        return self._distance / self._body.size

    def spent_tangent(self) -> Tangent | None:
        """Return the tangent with the work of this solve."""
        if self.tangent is None:
            return None
        return replace(self.tangent, spent=self.tangent.spent + max(0, self._work - self._free))

    def _approach(self, task: Task, target: float, limit: int, *, known: bool, last: bool) -> Descended:
        """Descend to within ``target`` [m].

        Args:
            task: what to descend in.
            target: of the distance.
            limit: most iterations.
            known: it lay within it but for the last update of multipliers.
            last: no finer target follows.
        """
        descended = self._run(task, target / SLACK, limit)
        self._distance = np.inf if descended.cut else SLACK * float(task.active.status["distance"])
        return descended

    def _still_near(self, task: Task, target: float) -> bool:
        """Tell whether multipliers that were updated leave what was near its equilibrium within the target [m].

        The step of a kept tangent that has been found to fall short of the distance does so here, too.
        """
        work = task.active.workspace
        task.precondition(work.gradient, work.step)
        self._prepared = True
        left = SLACK * self._shortfall * largest(work.step)
        if left <= target:
            self._distance = max(left, self._distance)
        return left <= target

    def _run(self, task: Task, goal: float, limit: int) -> Descended:
        """Iterate until the step is at most ``goal`` [m]; take the tangent anew where that takes long."""
        used, damping, before, status = 0, 0.0, np.inf, task.active.status
        while True:
            chunk = min(self._patient, limit - used)
            went = self._run_chunk(task, goal, chunk)
            self._prepared = True
            used, self._work = used + went.iterations, self._work + went.iterations
            # An almost singular tangent asks for a step beyond all reach; the energy need not be unbounded for that.
            astray = task.active.ended is End.RUNAWAY and status["blocked"] == 0
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

    def _run_chunk(self, task: Task, goal: float, limit: int) -> Descended:
        if self._level.kept is None:
            return self._run_stepwise(task, goal, goal, 0, limit, prepared=self._prepared)
        return self._run_kept(task, goal, limit, prepared=self._prepared)

    def _take(self, task: Task, x: NDArray[np.float64] | None = None, *, damping: float = 0.0) -> None:
        work = task.active.workspace
        self.tangent = self._level.take(task.problem, work.u, work.x if x is None else x, damping=damping)
        status, self._work, self._shortfall = task.active.status, 0, 1.0
        status["count"], status["pending"], status["ended"], self._prepared = 0, 0, End.NONE, False
