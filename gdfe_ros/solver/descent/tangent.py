# SPDX-License-Identifier: Apache-2.0
"""Minimisation with a kept tangent, which is renewed when that saves work: Newton steps in statics, L-BFGS in motion.

In statics conjugate gradients find the Newton step, and with it the distance to the equilibrium. The older the tangent
is, the more products they need. If the line search shortens a step, or conjugate gradients meet negative curvature,
L-BFGS continues, because its history contains the change of the tangent. In motion, tolerances are far finer, and
inertia keeps bodies from buckling: L-BFGS alone takes the fewest evaluations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import past
from gdfe_ros.solver.descent import newton, quasi_newton
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.minimiser import Descended, Minimiser, Task
from gdfe_ros.solver.descent.newton import StepKind, Why
from gdfe_ros.solver.descent.products import SPACING
from gdfe_ros.solver.descent.workspace import End, allocate
from gdfe_ros.solver.distance import largest
from gdfe_ros.solver.state import State
from gdfe_ros.solver.tangent.level import TangentLevel
from gdfe_ros.solver.tangent.tangent import Tangent

TRUST = 5.0
"""Largest tolerance of a solve, divided by the body's softness; a larger tolerance is reduced to it. The softness is
about the strain at which a slender body buckles. An axial strain with an error of this size doubles or removes the
bending stiffness, so that a small Newton step proves nothing.
"""
WORTH = 12
"""A new tangent pays after this number of products, without the `FREE` products of each Newton step."""
MOST_TANGENTS = 60
"""Limit of tangents in a solve. More are needed only if the potential is not smooth."""
MOST_UNKNOWN = 6
"""Limit of a solve's Newton steps without convergence of conjugate gradients. Such a body is about to buckle."""
MOVING = 0.2
"""In motion, a solve ends if the L-BFGS step, divided by the tolerance, is at most this. The distance to the
equilibrium then counts as five times the step.
"""
FLYING = 0.02
"""As `MOVING`, for a body without handles. Only the accuracy of the solve then conserves its angular momentum."""
PATIENT = 12
"""A new tangent counts as so many L-BFGS iterations, or as the number of solutions that its factor costs if that is
larger. It is renewed in a solve after as many successive iterations, and between solves as soon as this lowers the mean
cost of a solve: when the last solve took more iterations than the mean of all solves, the tangent's cost included.
"""
HIDDEN = 0.01
"""In the test for a saddle, all modes count as resolved if r . M^-1 r of a random right-hand side has decreased to this
fraction of its average initial part along one mode.
"""


class TangentMinimiser(Minimiser):
    """Minimises the potential of a body that has much softer modes than its constant matrix.

    Args:
        body: the discretised body.
        weight, bending: (m,) [Pa] and (m,) [N/m] weights of the elements in the constant matrix (see `assemble`).
        level: the tangent preconditioner; its first shift is the body's softness.
        moving: whether inertia is among the terms. If so, a body is never near buckling.

    Attributes:
        tangent: the kept tangent.
        lost: whether the solve was abandoned because the distance to the equilibrium cannot be estimated.
    """

    remembers = False

    def __init__(
        self,
        body: Body,
        weight: NDArray[np.float64],
        bending: NDArray[np.float64],
        level: TangentLevel,
        *,
        moving: bool,
    ) -> None:
        super().__init__(body, weight, bending)
        self.tangent, self.certified = None, not moving
        self._level, self._finest = level, TRUST * level.first_shift
        self._beside = allocate(body.unknowns.rows, body.rest, body.cells.shape, memory=0)
        self._krylov = newton.allocate_krylov(body.unknowns.rows, body.cells.shape)
        self._course = self._krylov.course.view(newton.COURSE, np.ndarray)[0]
        self._share = 1.0 if self.certified else MOVING if body.handles else FLYING
        self._spacing, self._patient, self._weight = SPACING * body.size, max(PATIENT, level.price), weight

    def begin(self, active: ActiveSet, start: State, *, warm: bool) -> None:
        """Prepare a solve with the tangent of ``start``.

        If the tangent is due for renewal, it is evaluated at the last equilibrium in a ``warm`` solve, else at the
        present positions.
        """
        super().begin(active, start, warm=True)
        active.status["count"], active.status["pending"] = 0, 0
        self.tangent, self._last = start.tangent, start.positions if warm else None
        if not self.certified and self.tangent is not None and self.tangent.overdue(self._patient):
            self.tangent = None
        self.lost, self._tangents, self._turned = False, 0, False
        self._known, self._exact = False, False
        self._cleared, self._warm, self._learning = 0, warm, not self.certified
        self._krylov.motion[...] = 0.0
        course = self._course
        course["distance"], course["curved"], course["unknown"] = np.inf, 0, 0
        if self.tangent is not None:
            self._level.load(self.tangent)
            course["spent"], course["least"] = self.tangent.spent, self.tangent.softest or 1.0
            self._before = self.tangent.spent

    def descend(self, task: Task, *, tolerance: float, final: float, least: int, limit: int) -> Descended:
        """Minimise until the estimated distance to the equilibrium is within the tolerance.

        Args:
            task: the problem.
            tolerance: estimated largest distance to the equilibrium, divided by the body's size.
            final: the tolerance of the whole solve.
            least: not used.
            limit: largest number of iterations.
        """
        task.evaluate()
        work, last = task.active.workspace, tolerance <= final
        target = self._share * self._body.size * (min(tolerance, self._finest) if last else tolerance)
        self._beside.x[...] = work.x  # includes the present positions of the handles
        if self.certified and self._last is not None:
            free = task.active.unknowns.free
            self._krylov.motion.reshape(-1, 3)[: len(free)] = work.x[free] - self._last[free]
        if self.tangent is None:
            self._take(task, self._last)
        if not self._turned:
            self._level.turn(work.x)
            self._turned = True
        self.tangent = self._level.reconnected(self.tangent, work.x)
        task.precondition(work.gradient, work.step)
        left = largest(work.step) / float(self._course["least"])
        # An update of multipliers has changed the forces by little, or the prediction of a motion is exact.
        proven = self._known and (self._exact or not last)
        if left <= target and (proven or not self.certified) and not (last and self._doubtful):
            self._course["distance"] = left
            return Descended(0, cut=False)
        return self._iterate_to(task, target, limit, last=last)

    def error_estimate(self, active: ActiveSet) -> float:
        """Return the distance to the equilibrium, divided by the body's size; infinite if it is unknown."""
        return float(self._course["distance"]) / self._body.size

    def spent_tangent(self) -> Tangent | None:
        """Return the kept tangent for the next solve, with the cost of this solve added; None if there is none."""
        if self.tangent is None:
            return None
        course, tangent = self._course, self.tangent
        softest, spent = float(course["least"]) if tangent.softest > 0.0 else 0.0, int(course["spent"])
        return replace(tangent, softest=softest, spent=spent, solves=tangent.solves + 1, latest=spent - self._before)

    @property
    def _hard(self) -> int:
        """Number of Newton steps in this solve with unconverged conjugate gradients. They do not prove a minimum."""
        return int(self._course["curved"] + self._course["unknown"])

    @property
    def _doubtful(self) -> bool:
        """Whether the equilibrium may be a saddle, or nearer to one than is known.

        This is so after hard steps, with a shifted tangent, or in a solve not warm with a tangent not yet searched.
        """
        known = self.tangent.softest and (self._warm or self.tangent.searched)
        return self.certified and (not known or self._hard > self._cleared)

    def _iterate_to(self, task: Task, target: float, limit: int, *, last: bool) -> Descended:
        """Iterate until the distance to the equilibrium is within ``target`` [m].

        If ``last``, test whether a doubtful equilibrium is a saddle. The iterations continue beside a saddle.
        """
        used, course, status, self._since = 0, self._course, task.active.status, 0
        self._known, self._exact = False, last
        shift, before = 0.0, np.inf
        while True:
            why, made = self._iterate_once(task, target, limit - used)
            used += made
            if self._tangents > MOST_TANGENTS or course["unknown"] > MOST_UNKNOWN:
                self.lost, course["distance"] = True, np.inf
                return Descended(used, cut=False)
            if why is Why.ENDED:
                return Descended(used, cut=False)
            if why is Why.NEAR:
                if last and self._doubtful and not self._asked(task, target):
                    continue
                self._known = True
                return Descended(used, cut=False)
            if used >= limit or (used > 0 and past(task.deadline)):
                return Descended(used, cut=True)
            if why in (Why.STALE, Why.HARD, Why.ASTRAY):
                step = float(status["distance"])
                shift, before = self._damped(shift, step, before, astray=why is Why.ASTRAY), step
                # A prediction may be strained along stiff directions, which stiffens the soft ones, too.
                self._take(task, self._last if why is Why.STALE and not used else None, shift=shift)
                task.precondition(task.active.workspace.gradient, task.active.workspace.step)
                self._learning = why is Why.HARD or not self.certified

    def _damped(self, shift: float, step: float, before: float, *, astray: bool) -> float:
        """Return the next tangent's multiple of the constant matrix. In motion, it grows while steps do not shrink.

        An almost singular tangent causes steps that are far too long. ``shift`` is the multiple in the last tangent,
        and ``step`` and ``before`` [m] are the last steps with the last two tangents.
        """
        if self.certified or not (astray or step > 0.5 * before):
            return shift
        return self._level.next_shift(shift)

    def _iterate_once(self, task: Task, target: float, limit: int) -> tuple[Why, int]:
        """Iterate in one compiled call; with an observer or a deadline, the call makes a single iteration."""
        work, most = task.active.workspace, 1 if self.observer or task.deadline else limit
        self._show(work, begins=True)
        with task.turn:
            why, used = (self._quasi_newton if self._learning else self._newton)(task, target, most)
        self._show(work, begins=False)
        return why, used

    def _newton(self, task: Task, target: float, most: int) -> tuple[Why, int]:
        given = task.problem, task.active.workspace, self._beside, self._level.kept, self._krylov
        arc = self._weight, task.coupling.inverse
        why, used = newton.iterate(*given, *arc, self._body.size, self._spacing, target, self._exact, WORTH, most)
        return Why(why), used

    def _quasi_newton(self, task: Task, target: float, most: int) -> tuple[Why, int]:
        """Iterate by L-BFGS, whose history contains the change of the tangent. In statics, Newton steps follow."""
        course, status = self._course, task.active.status
        most = min(most, self._patient - self._since)
        target = min(target, self._share * self._body.size * self._finest)
        used = quasi_newton.descend_kept(task.problem, task.active.workspace, self._level.kept, target, most)
        course["spent"], course["distance"] = course["spent"] + used, float(status["distance"]) / self._share
        self._since += used
        if self.certified:
            self._learning, course["distance"] = used == most and self._since < self._patient, np.inf
            status["ended"] = End.NONE
            return Why.LIMIT, used
        if used == most:
            return Why.STALE if self._since == self._patient else Why.LIMIT, used
        if task.active.ended is End.RUNAWAY and status["blocked"] == 0:
            return Why.ASTRAY, used
        return Why.NEAR if task.active.ended is End.NONE else Why.ENDED, used

    def _asked(self, task: Task, target: float) -> bool:
        """Return whether conjugate gradients prove that the equilibrium is a minimum, with a random right-hand side.

        This right-hand side contains all modes. If a direction of negative curvature is found, the body is moved along
        it; the first step has the length ``target`` [m].
        """
        work, krylov = task.active.workspace, self._krylov
        distance = float(self._course["distance"])
        krylov.residual[...], krylov.motion[...] = np.random.default_rng(0).standard_normal(len(work.u)), 0.0
        self._level.solve(krylov.residual, krylov.z)
        given = task.problem, work, self._beside, self._level.kept, krylov
        before = float(self._course["least"])
        with task.turn:
            solved, _ = newton.solve_newton(*given, self._spacing, 0.0, HIDDEN / len(work.u))
        if solved == StepKind.FOUND:
            self.tangent = replace(self.tangent, softest=float(self._course["least"]), searched=True)
            self._course["distance"], self._cleared = distance * before / float(self._course["least"]), self._hard
            return True
        self._course["unknown"] += 1
        if solved == StepKind.CURVED:
            self._move_along(task, krylov.direction, target)
        self._take(task)
        task.precondition(work.gradient, work.step)
        return False

    def _move_along(self, task: Task, direction: NDArray[np.float64], length: float) -> None:
        """Leave a saddle along a direction (3 r,) of negative curvature, by steps that double while the energy falls.

        ``length`` [m] is the length of the first step.
        """
        work, status = task.active.workspace, task.active.status
        sign = -1.0 if float(work.gradient @ direction) > 0.0 else 1.0
        while length < newton.AWAY * self._body.size:
            work.direction[...] = sign * length / largest(direction) * direction
            status["slope"], status["distance"] = float(work.gradient @ work.direction), length
            status["given"], status["ended"] = 1, End.NONE
            if task.advance(0.0) or status["length"] < 1.0:
                return
            length *= 2.0

    def _take(self, task: Task, x: NDArray[np.float64] | None = None, *, shift: float = 0.0) -> None:
        """Renew the tangent at positions ``x`` (n, 3) [m], and rotate it to the present positions.

        If ``x`` is None, the tangent is evaluated at the present positions.
        """
        work, course = task.active.workspace, self._course
        self.tangent = self._level.take(task.problem, work.u, work.x if x is None else x, shift=shift)
        if x is not None:
            self._level.turn(work.x)
        self._tangents, self._turned = self._tangents + 1, True
        course["spent"], course["least"], self._since, self._before = 0, 1.0, 0, 0
        task.active.status["count"], task.active.status["pending"], task.active.status["ended"] = 0, 0, End.NONE
