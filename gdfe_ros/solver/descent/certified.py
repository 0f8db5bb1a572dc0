# SPDX-License-Identifier: Apache-2.0
"""Minimisation with a kept tangent that ends when conjugate gradients with the present tangent certify the distance."""

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
"""Largest ratio of successive Newton steps for which the second one is accepted as the distance to the equilibrium."""
NEAR = 0.1
"""Length of a Newton step, over the tolerance, that is accepted as the distance without a step before it."""
AWAY = 0.02
"""First step along a direction of negative curvature, over the body's size."""
MOST_UNKNOWN = 3
"""Limit of failed distance estimates by conjugate gradients in a solve: the body is about to buckle."""
MOST_ROUNDS = 1000
"""Limit of Newton steps in a minimisation; a solve makes a few."""
FREE = 6
"""Iterations and products of a solve that do not count towards the cost at which the tangent is renewed."""


class CertifiedMinimiser(TangentMinimiser):
    """Minimises to an equilibrium, and certifies its distance by conjugate gradients with the present tangent.

    Near buckling the step by the kept tangent does not measure the remaining distance.

    Args:
        body: the discretised body.
        weight, bending: (m,) [Pa] and (m,) [N/m] of the constant matrix.
        level: the tangent preconditioner.
        softness: stiffness of the softest mode over that of the constant matrix.
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
        """Begin a solve, and reset the count of failed distance estimates."""
        super().begin(active, start, warm=warm)
        self._unknown = 0

    def _approach(self, task: Task, target: float, limit: int, *, known: bool, last: bool) -> Descended:
        """Minimise until the step is short enough; for the last target, until the distance is certified."""
        return self._certify(task, target, limit, known=known) if last else self._run(task, target, limit)

    def _certify(self, task: Task, target: float, limit: int, *, known: bool) -> Descended:
        """Minimise until two successive Newton steps, the second much shorter, certify the ``target`` [m].

        If the distance was ``known`` before the last update of multipliers, one such step is enough.
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
                # A few products with a shifted tangent do not show soft modes that the shift has stiffened.
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
        """Return an estimate for a random right-hand side, which shows soft modes and negative curvature.

        At a saddle the forces have no component along such modes.
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
        """Return a step along a direction (3 r,) of negative curvature, long enough to leave the saddle."""
        return AWAY * self._body.size / largest(direction) * direction

    def _follow(self, task: Task, step: NDArray[np.float64]) -> bool:
        """Search along a step (3 r,); return whether it lowers the energy."""
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
