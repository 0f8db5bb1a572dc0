# SPDX-License-Identifier: Apache-2.0
"""Minimisation with a kept tangent: L-BFGS whose initial matrix is a recent stiffness, renewed when that pays."""

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
"""Largest tolerance over the body's softness; larger ones are reduced to it. Softness is, to a factor, the strain at
which a slender body buckles. A shape whose length is off by that much is as much too stiff or too soft, so that a
small Newton step means nothing there."""
SLACK = 5.0
"""Assumed ratio of the distance to the step by the kept tangent."""
PATIENT = 12
"""Successive iterations after which the tangent is renewed."""
MOST_TANGENTS = 20
"""Limit of tangents in a solve. Beyond it the potential is not smooth, as where points of a cable meet."""
DAMPING = 10.0
"""Growth factor of the constant matrix's share if steps do not shrink, which starts at the body's softness. An almost
singular tangent causes steps that are far too long."""
WORTH = 24
"""Iterations and products, beyond the free ones of a solve, that justify a new tangent."""


class TangentMinimiser(Minimiser):
    """Minimises the potential of a body that has much softer modes than its constant matrix.

    Its distance to the equilibrium is the step by the kept tangent, which suffices in motion: with inertia a body is
    never near buckling. The tangent is renewed when the iterations with it have cost as much as a new one.

    Args:
        body: the discretised body.
        weight, bending: (m,) [Pa] and (m,) [N/m] of the constant matrix.
        level: the tangent preconditioner.
        softness: stiffness of the softest mode over that of the constant matrix.

    Attributes:
        tangent: the kept tangent.
        lost: whether the solve was abandoned because the distance to the equilibrium cannot be estimated.
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

        A tangent that is due is evaluated at the last equilibrium if the solve is ``warm``, otherwise at its start.
        """
        super().begin(active, start, warm=True)
        self.tangent, self._last = start.tangent, start.positions if warm else None
        self._work, self._distance, self._shortfall = 0, np.inf, 1.0
        self.lost, self._tangents = False, 0
        if self.tangent is not None:
            self._level.load(self.tangent)

    def descend(self, task: Task, *, tolerance: float, final: float, least: int, limit: int) -> Descended:
        """Minimise until the distance is within the tolerance.

        Args:
            task: the problem; its terms are evaluated at the present unknowns.
            tolerance: estimated largest distance to the equilibrium over the body's size.
            final: the tolerance of the whole solve.
            least: not used.
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
        """Return the distance to the equilibrium over the body's size; infinite if it is unknown."""
        return self._distance / self._body.size

    def spent_tangent(self) -> Tangent | None:
        """Return the tangent with the cost of this solve added."""
        if self.tangent is None:
            return None
        return replace(self.tangent, spent=self.tangent.spent + max(0, self._work - self._free))

    def _approach(self, task: Task, target: float, limit: int, *, known: bool, last: bool) -> Descended:
        """Minimise to within ``target`` [m].

        Args:
            task: the problem.
            target: largest distance [m].
            limit: most iterations.
            known: whether the distance was within the target before the last update of multipliers.
            last: whether no finer target follows.
        """
        descended = self._run(task, target / SLACK, limit)
        self._distance = np.inf if descended.cut else SLACK * float(task.active.status["distance"])
        return descended

    def _still_near(self, task: Task, target: float) -> bool:
        """Return whether the distance is still within the target [m] after an update of multipliers.

        The step by the kept tangent is enlarged by the ratio by which it was found to fall short of the distance.
        """
        work = task.active.workspace
        task.precondition(work.gradient, work.step)
        self._prepared = True
        left = SLACK * self._shortfall * largest(work.step)
        if left <= target:
            self._distance = max(left, self._distance)
        return left <= target

    def _run(self, task: Task, goal: float, limit: int) -> Descended:
        """Iterate until the step is at most ``goal`` [m]; renew the tangent if that takes many iterations."""
        used, damping, before, status = 0, 0.0, np.inf, task.active.status
        while True:
            chunk = min(self._patient, limit - used)
            went = self._run_chunk(task, goal, chunk)
            self._prepared = True
            used, self._work = used + went.iterations, self._work + went.iterations
            # An almost singular tangent causes a step beyond all bounds, even if the energy has a lower bound.
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
