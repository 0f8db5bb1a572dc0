# SPDX-License-Identifier: Apache-2.0
"""Descents on a kept tangent, which end when conjugate gradients on the present one say how far the equilibrium is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import past
from gdfe_ros.solver.descent import pairs
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.minimiser import Descended, Task
from gdfe_ros.solver.descent.products import TangentProducts
from gdfe_ros.solver.descent.tangent import PATIENT, WORTH, TangentMinimiser
from gdfe_ros.solver.descent.workspace import End
from gdfe_ros.solver.distance import largest
from gdfe_ros.solver.state import State
from gdfe_ros.solver.tangent.estimate import HIDDEN, Estimate, estimate
from gdfe_ros.solver.tangent.level import TangentLevel

CONTRACTION = 0.5
"""Newton step over the last one from which on Newton steps are believed to tell the distance."""
NEAR = 0.1
"""Of the tolerance: a Newton step that is believed without another one before."""
AWAY = 0.02
"""Of the body's size: a first step along a direction of negative curvature."""
MOST_UNKNOWN = 3
"""Times in a solve that conjugate gradients may leave the distance unknown: the body is about to buckle."""
MOST_ROUNDS = 1000
"""Newton steps that a descent may ask for; a solve makes a few."""
FREE = 6
"""Iterations and products that a solve has free, before it counts that they are worth a new tangent."""


class CertifiedMinimiser(TangentMinimiser):
    """Descends to equilibria: conjugate gradients on the present tangent tell how far they are.

    Near buckling the step that the kept tangent makes says nothing of that.

    Args:
        body: the discretised body.
        weight, bending: (m,) [Pa] and (m,) [N/m] of the constant matrix.
        level: the body's tangents.
        softness: stiffness of its softest motion over that of the constant matrix.
    """

    certified = True

    def __init__(
        self,
        body: Body,
        weight: NDArray[np.float64],
        bending: NDArray[np.float64],
        level: TangentLevel,
        softness: float,
    ) -> None:
        super().__init__(body, weight, bending, level, softness)
        self._product = TangentProducts(body)
        self._patient, self._free, self._worth = PATIENT, FREE, WORTH

    def begin(self, active: ActiveSet, start: State, *, warm: bool) -> None:
        """Begin a solve; how often the distance was not known is counted anew."""
        super().begin(active, start, warm=warm)
        self._unknown = 0

    def _approach(self, task: Task, target: float, limit: int, *, known: bool, last: bool) -> Descended:
        """Descend until the step is short enough; the last time, until the distance is known to be."""
        return self._certify(task, target, limit, known=known) if last else self._run(task, target, limit)

    def _certify(self, task: Task, target: float, limit: int, *, known: bool) -> Descended:
        """Descend until two Newton steps in a row, the second much shorter, tell that it is within ``target`` [m].

        Where the distance is ``known`` but for the last update of multipliers, one such step is enough.
        """
        used, nothing = 0, NEAR * target / CONTRACTION
        before = np.inf if known else nothing
        for _ in range(MOST_ROUNDS):
            went = self._run(task, target, limit - used)
            used += went.iterations
            if went.cut or self.lost or task.active.ended is End.RUNAWAY:
                return Descended(used, went.cut)
            found = self._ask(task, target)
            self._distance = found.distance
            near = found.known and found.distance <= min(target, CONTRACTION * before)
            if near and self.tangent.softest:
                return Descended(used, cut=False)
            if used >= limit or (used > 0 and past(task.deadline)):
                return Descended(used, cut=True)
            self._unknown += not found.known
            if self._unknown > MOST_UNKNOWN:
                self.lost, self._distance = True, np.inf
                return Descended(used, cut=False)
            if near or (found.definite and not found.known):
                # Soft motions that what was added to a tangent has stiffened hide from a few products with it.
                self._take(task)
                found = self._probed(task) if near and not self.tangent.softest else found
                if found.definite:
                    continue
            step = found.step if found.known else self._away(found.step)
            if not self._follow(task, step):
                return Descended(used, cut=False)
            used, before = used + 1, max(before, found.distance) if found.known else nothing
        self.lost, self._distance = True, np.inf
        return Descended(used, cut=False)

    def _ask(self, task: Task, target: float) -> Estimate:
        self._product.begin(task)
        work = task.active.workspace
        before = largest(work.step)
        least = self.tangent.softest or 1.0
        found = estimate(self._product, work.gradient, work.step, self._level.solve, target, least=least)
        if found.known and before > 0.0:
            self._shortfall = max(self._shortfall, found.distance / before)
        self._work += found.products
        if self.tangent.softest and found.known:
            self.tangent = replace(self.tangent, softest=found.least)
        return found

    def _probed(self, task: Task) -> Estimate:
        """Look for soft motions, and for negative curvature, from a right-hand side that has all motions in it.

        At a saddle no force leads to them.
        """
        self._product.begin(task)
        gradient = task.active.workspace.gradient
        probe, answer = np.random.default_rng(0).standard_normal(len(gradient)), np.empty_like(gradient)
        self._level.solve(probe, answer)
        hidden = HIDDEN / len(gradient)
        found = estimate(self._product, probe, answer, self._level.solve, 0.0, left_over=hidden)
        self._work += found.products
        if found.known:
            self.tangent = replace(self.tangent, softest=found.least)
        else:
            self._distance, self._unknown = np.inf, self._unknown + 1
        return found._replace(step=-found.step) if gradient @ found.step > 0.0 else found

    def _away(self, direction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a step along a direction (3 r,) of negative curvature that is long enough to leave it."""
        return AWAY * self._body.size / largest(direction) * direction

    def _follow(self, task: Task, step: NDArray[np.float64]) -> bool:
        """Search along a step (3 r,); tell whether it leads down."""
        work, status = task.active.workspace, task.active.status
        if status["pending"]:
            pairs.take_products(work, None)
        status["slope"], status["distance"] = float(work.gradient @ step), largest(step)
        if not status["slope"] < 0.0:
            return False
        work.direction[...], status["given"], status["ended"] = step, 1, End.NONE
        if task.advance(0.0):
            return False
        task.precondition(work.gradient, work.step)
        pairs.remember(work)
        self._work, self._prepared = self._work + 1, True
        return True
