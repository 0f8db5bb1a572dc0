# SPDX-License-Identifier: Apache-2.0
"""One solve of the policy ``energy``: minimisations, multiplier updates between them, and the solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import past
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.pairs import history, load_history
from gdfe_ros.solver.descent.search import ROUNDING
from gdfe_ros.solver.descent.workspace import Problem
from gdfe_ros.solver.elements.barrier import flattened
from gdfe_ros.solver.elements.measures import LEAST_SCALE, MOST_SCALE, update_hourglass_scales
from gdfe_ros.solver.elements.response import Watch
from gdfe_ros.solver.equilibrium.predictor import Prediction
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.forces.pressures import Pressures, store_energies
from gdfe_ros.solver.forces.reactions import handle_reactions
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.minimise.minimiser import Minimiser, Task
from gdfe_ros.solver.outcome import Outcome, join, tell
from gdfe_ros.solver.solution import Increment, Solution
from gdfe_ros.solver.state import ElementState, State, Summary, Unfinished


class DescentSchedule:
    """Tolerances of the minimisations between which multipliers are updated: coarse at first, the solve's at the end.

    Args:
        tolerance: tolerance of the solve.
        first: tolerance of the first minimisation.

    Attributes:
        present: tolerance of the present minimisation.
    """

    FIRST_TOLERANCE, TIGHTEN = 1e-2, 0.1
    """If multipliers are updated: tolerance of the first minimisation, and factor from each tolerance to the next."""

    def __init__(self, tolerance: float, *, first: float) -> None:
        self._tolerance, self._finest, self._aim, self.present = tolerance, tolerance, first, first

    def aim(self, *, confirms: bool) -> float:
        """Return the tolerance of the next minimisation; if it only ``confirms`` the positions, that of the solve."""
        self._aim = self._tolerance if confirms else self.present
        return self._aim

    @property
    def exact(self) -> bool:
        """Whether the last minimisation had the tolerance of the solve, or a finer one that was asked for."""
        return self.present <= self._tolerance and self._aim <= self.present

    def refine(self) -> None:
        """Decrease the tolerance of the solve: multipliers still change, but by too little for another iteration."""
        self._finest *= self.TIGHTEN

    def tighten(self) -> None:
        """Decrease the tolerance for the next minimisation, at most to that of the solve."""
        self.present = max(self._finest, self.TIGHTEN * self.present)


@dataclass(frozen=True, eq=False)
class Model:
    """Data common to all solves of a body: body, external terms, kinematics of its handles, and minimiser.

    Attributes:
        softening: whether hourglass scales follow the strain. With ``newmark`` they stay constant, because a change of
            scale would create or remove energy.
        moving: whether inertia is among the terms.
    """

    body: Body
    actuation: Actuation
    handles: HandleMotions
    minimiser: Minimiser
    softening: bool = True
    moving: bool = False


class Solve:
    """A solve in progress.

    Args:
        model: data common to all solves.
        problem: the requested increment.
        start: state at the beginning.
        base: (n, 3) [m]; rows of handle vertices are their commanded positions.
        prediction: positions at the beginning.

    Attributes:
        problem, start: the arguments.
        anew: whether the solve continues no motion.
        turns: (p, 3) free rotation vectors [rad] of the handles at the beginning.
        pressures: the elements' pressures, multipliers of their volumes.
        iterations: number of iterations of the last call of `descend`.
    """

    LINEAR = 1e-4
    """Coarsest tolerance of the last minimisation in statics. Farther from the equilibrium, a step with the tangent
    does not measure the distance: the bending stiffness of a sheet or of a hanging bar changes within a thickness.
    """
    FAINT = 0.3
    """If the error of a constraint, or the change of an hourglass scale, exceeds this multiple of the tolerance, a
    minimisation has to show that the positions are still within the tolerance. (With a single cell across, the whole
    bending stiffness follows the scale.)
    """
    LAGGING_VOLUME, LAGGING_SCALE = 10.0, 100.0
    """Allowed errors of volumes, and allowed changes of hourglass scales in the last update, in motion and divided by
    the tolerance. The updates of the next step reduce these errors.
    """
    SLOW = 10
    """If this number of updates of exact minimisations does not settle the constraints, the minimisations become finer.
    """
    MOST_UPDATES = 200
    """Limit of the updates of pressures, multipliers and scales in one solve. Confined, incompressible bodies need
    most.
    """

    def __init__(
        self,
        model: Model,
        problem: Increment,
        start: State,
        base: NDArray[np.float64],
        prediction: Prediction,
    ) -> None:
        self._minimiser, self._body, self._actuation = model.minimiser, model.body, model.actuation
        self._softening, self._moving = model.softening, model.moving
        self.problem, self.start = problem, start
        self.anew = not prediction.ratio
        self._base, self._frame, self._prediction = base, model.handles.frame(base), prediction
        self._operators = self._actuation.growths.at(problem.commands, start.operators)
        self.iterations, self._watch = 0, Watch.over(len(self._body.material))
        same = start.poses == problem.poses and start.commands == problem.commands
        self._resumed = start.unfinished if same else None
        self._begin_anew()

    @property
    def aim(self) -> float:
        """Tolerance of the last minimisation."""
        return self.problem.tolerance if self._moving else min(self.problem.tolerance, self.LINEAR)

    @property
    def interrupted(self) -> bool:
        """Whether the load path to the command was divided, or an earlier solve was cut."""
        return self.problem.begins > 0.0 or self._resumed is not None

    @classmethod
    def at(cls, model: Model, state: State) -> Solve:
        """Return a solve that begins exactly at a state."""
        problem = Increment.at(state, tolerance=1.0, limit=0)
        here = Prediction(state.positions, state.slides, state.turns, 0.0)
        return cls(model, problem, state, state.base, here)

    def _begin_anew(self) -> None:
        """Start from the prediction, with extrapolated multipliers."""
        start, here = self.start, self._prediction
        self._positions, self._slides, self.turns = here.positions, here.slides, here.turns
        self._tangent = start.tangent
        self.pressures = Pressures(self._body, start.elements, here.ratio)
        last, before = start.elements.hourglass_scale, start.elements.hourglass_scale_before
        self._scale = np.clip(last + here.ratio * (last - before), LEAST_SCALE, MOST_SCALE)
        given = here.positions, self.problem.poses, start
        self._actuation.begin(self.problem.commands, start.terms, *given, ratio=here.ratio)

    def go_on_from(self, state: State) -> None:
        """Start from ``state``, which this solve has reached or left, with unchanged multipliers."""
        self._positions, self._slides, self.turns = state.positions, state.slides, state.turns
        self._tangent = state.tangent
        self.pressures.begin()

    def evaluate(self, active: ActiveSet, *, threads: int | None) -> Task:
        """Set the unknowns to the start and evaluate all terms there; return the minimisation's task."""
        task = self._placed(active, threads)
        task.evaluate()
        return task

    def _placed(self, active: ActiveSet, threads: int | None) -> Task:
        """Set the unknowns to the start; return the minimisation's task."""
        blocks = self._operators.blocks if self._actuation.growths else active.blocks
        problem = Problem(
            self._operators.shape,
            blocks,
            self._body.material,
            self.pressures.values,
            self._scale,
            self.pressures.table,
            self._watch,
            active.unknowns,
            self._frame,
            self._actuation.table,
            threads,
        )
        active.place(self._positions, self._base, self._slides, self.turns)
        self._watch.room[...] = -1.0
        gives_up = self._inflates if self.problem.divisible else None
        return Task(active, problem, self.problem.deadline, gives_up)

    def _inflates(self, positions: NDArray[np.float64]) -> bool:
        """Return whether a chamber of given pressure inflated far since the last equilibrium."""
        last = self.start.anchor or self.start
        return bool(self._actuation.unstable(positions, last.positions, self.problem.commands))

    def descend(self, active: ActiveSet, *, threads: int | None, limit: int) -> None:
        """Minimise and update multipliers in turn, until the constraints are satisfied to the tolerance."""
        self._begin_minimiser(active)
        task = self._placed(active, threads)
        updates = bool(len(active.carried) or self._actuation.updates or self._softens(active))
        self._schedule = self._scheduled(updates=updates)
        self._settled, self._exact, self.iterations, self._cut = not updates, 0, 0, False
        for _ in range(self.MOST_UPDATES):
            aim, left = self._schedule.aim(confirms=self._settled and updates), limit - self.iterations
            went = self._minimiser.descend(task, tolerance=aim, limit=left, proven=self._settled and updates)
            self.iterations, self._cut = self.iterations + went, active.ended is Outcome.CUT
            if not updates or self._failed(active):
                break
            if self._balanced(active, still=went == 0) or self._actuation.wanders:
                break
            self._schedule.tighten()
            if self._is_late(limit):
                break

    def _is_late(self, limit: int) -> bool:
        """Return whether the limit of iterations or the deadline ends the solve, and remember it."""
        self._cut = self.iterations >= limit or (self.iterations > 0 and past(self.problem.deadline))
        return self._cut

    def _scheduled(self, *, updates: bool) -> DescentSchedule:
        """Return the tolerances of the minimisations; those of an unfinished solve go on where it ended."""
        tolerance, resumed = self.aim, self._resumed
        first = max(DescentSchedule.FIRST_TOLERANCE, tolerance) if updates and self.anew else tolerance
        if resumed is not None:
            first = max(resumed.tolerance, tolerance)
        return DescentSchedule(tolerance, first=first)

    def _begin_minimiser(self, active: ActiveSet) -> None:
        """Give the minimiser the tangent of the start, and at first the pairs of an unfinished solve."""
        self._minimiser.begin(active, self._tangent)
        if self._resumed is not None and not self.iterations:
            load_history(active.workspace, self._resumed.steps, self._resumed.changes)

    def _failed(self, active: ActiveSet) -> bool:
        """Return whether the last minimisation was cut, ran away or was given up, so that updates are useless."""
        if active.ended in (Outcome.STALLED, Outcome.EXHAUSTED):
            return bool(active.status["blocked"])
        return active.ended in (Outcome.RUNAWAY, Outcome.GIVEN_UP, Outcome.CUT)

    def _balanced(self, active: ActiveSet, *, still: bool) -> bool:
        """Update pressures, multipliers and scales, unless the last update stands; return whether the solve ends.

        In statics, the solve ends if the last update was faint, or if the minimisation after it made no iteration
        (``still``). In motion, it ends after the first update that keeps the constraints.
        """
        if still and self._settled:  # the last update has not moved the equilibrium
            return True
        # Even if no further descent is possible, new pressures and scales may make one possible.
        last = self._schedule.exact or active.ended is not Outcome.NEAR
        error, change = self._update(active, still=still)
        kept = 1.0 if self._moving or self._actuation.contacts else self.FAINT
        self._settled = last and error <= kept
        self._exact += last
        if last and not self._settled and (still or self._exact % self.SLOW == 0):
            self._schedule.refine()  # the positions are not accurate enough for the constraints
        faint = max(error, change) <= self.FAINT and not self._actuation.contacts
        return self._settled and (still or faint or self._moving)

    def measure(self, active: ActiveSet, stored: NDArray[np.float64], least: NDArray[np.float64]) -> None:
        """Write energies [J] and least volume ratios of the active elements to ``stored`` and ``least`` (m,)."""
        work, body, pressures = active.workspace, self._body, self.pressures
        given = work.x, active.elements, self._operators.shape, body.material, pressures.table, pressures.values
        store_energies(*given, work.energies, stored, least, True)

    def solution(self, active: ActiveSet, stored: NDArray[np.float64], least: NDArray[np.float64]) -> Solution:
        """Return the solution after `descend`; `measure` fills ``stored`` and ``least`` (m,)."""
        work, start, problem = active.workspace, self.start, self.problem
        self.measure(active, stored, least)
        positions = work.x.copy()
        slides, turns = active.rigid_motion()
        outcome, estimate = self._judge(active)
        flaw, message = self._actuation.flaw(positions), self._explain(outcome, estimate, active)
        converged = outcome is Outcome.NEAR and not flaw and bool(least.min() > 0.0)
        message = join(flaw, message, "" if converged else flattened(least))
        terms = self._actuation.finish(start.terms, positions)  # contacts give their reactions only after it
        outside = work.outside if self._actuation.terms else None
        others = self._actuation.contacts, self._actuation.grips
        summary = Summary(
            converged=converged,
            error_estimate=estimate,
            energy=float(stored.sum()),
            min_det=float(least.min()),
            reactions=handle_reactions(self._body, positions, work.force, outside, *others),
            actuators=self._actuation.states(positions, problem.commands, self._operators),
            terms=self._actuation.reports(positions),
            message=message,
            estimated=self._minimiser.tangent is None and len(active.unknowns.free) > 0,
        )
        carried = len(active.carried) > 0
        elements = ElementState(
            pressures=self.pressures.values.copy() if carried else start.elements.pressures,
            pressures_before=start.elements.pressures,
            bulk=self.pressures.bulk,
            hourglass_scale=self._scale.copy(),
            hourglass_scale_before=start.elements.hourglass_scale,
        )
        energetic = converged and not self._actuation.growths
        return Solution(
            state=start.with_(
                positions=positions,
                base=self._base,
                poses=problem.poses,
                commands=problem.commands,
                slides=slides,
                turns=turns,
                terms=terms,
                elements=elements,
                operators=self._operators,
                balance=self._actuation.balance(positions, problem.commands) if energetic else None,
                tangent=self._minimiser.used_tangent(),
                unfinished=self._unfinished(active) if self._cut and not converged else None,
                summary=summary,
            ),
            iterations=self.iterations,
            ended=Outcome.NEAR if converged else Outcome.CUT if self._cut else active.ended,
            entered=bool(flaw),
            began=self._prediction.positions,
        )

    def _update(self, active: ActiveSet, *, still: bool) -> tuple[float, float]:
        """Update pressures, multipliers and scales.

        Returns:
            The largest error of a constraint and the largest change of an hourglass scale, both divided by the
            tolerance.
        """
        x, errors, change = active.workspace.x, [0.0], 0.0
        tolerance = self.problem.keeping or self.problem.tolerance
        if len(active.carried):
            wrong = self.pressures.update(x, active.carried, self._operators.shape, still=still)
            errors.append(wrong / (self.problem.volumes or tolerance * (self.LAGGING_VOLUME if self._moving else 1.0)))
        if self._actuation.updates:
            errors.append(self._actuation.update(x) / tolerance)
        if self._softens(active):
            given = x, active.softening, self._operators.shape, self._body.material, self._body.table, self._scale
            change = update_hourglass_scales(*given) / tolerance
        if self._moving:
            errors.append(change / self.LAGGING_SCALE)
        return float(np.max(errors)), change

    def _softens(self, active: ActiveSet) -> bool:
        """Return whether hourglass scales follow the strain."""
        return self._softening and len(active.softening) > 0

    def _judge(self, active: ActiveSet) -> tuple[Outcome, float]:
        """Return how the solve ended, `Outcome.NEAR` at an equilibrium, and the error estimate."""
        tolerance, estimate = self.problem.tolerance, self._minimiser.error_estimate(active)
        forces, drowned = self._minimiser.contact_forces, ROUNDING * float(active.status["outside"])
        left, settled = (forces.left, forces.settled) if forces else (0.0, True)
        cases = (
            (drowned > self._body.strain_energy_scale, Outcome.TOO_STRONG),
            (self._cut, Outcome.CUT),
            (left > tolerance * self._body.size, Outcome.PUSHED),
            (estimate <= tolerance and self._settled, Outcome.NEAR),
            (estimate <= tolerance, Outcome.UNSETTLED),
            (active.ended is Outcome.GIVEN_UP and not settled, Outcome.TOUCHING),
            (not np.isfinite(estimate), Outcome.AT_EDGE),
            (True, Outcome.EXHAUSTED),
        )
        outcome = next(each for holds, each in cases if holds)
        return outcome, np.inf if outcome in (Outcome.TOO_STRONG, Outcome.CUT) else estimate

    def _explain(self, outcome: Outcome, estimate: float, active: ActiveSet) -> str:
        """Return a message about the defect of a solve that ended with ``outcome``."""
        late, problem = self._cut and past(self.problem.deadline), self.problem
        return tell(
            outcome,
            estimate=estimate,
            tolerance=problem.tolerance,
            reason=problem.deadline.reason if late else f"stopped after {problem.limit} iterations",
            far=float(active.status["step"]) / self._body.size,
            updates=self.MOST_UPDATES,
            where=self._minimiser.contact_forces.told() if outcome is Outcome.PUSHED else "",
        )

    def _unfinished(self, active: ActiveSet) -> Unfinished:
        done = self._resumed.iterations if self._resumed else 0
        steps, changes = history(active.workspace)
        tolerance = self._schedule.present
        return Unfinished(tolerance=tolerance, iterations=done + self.iterations, steps=steps, changes=changes)
