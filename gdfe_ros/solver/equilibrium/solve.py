# SPDX-License-Identifier: Apache-2.0
"""One solve of the policy ``energy``: minimisations, multiplier updates between them, and the solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.lbfgs_workspace import Problem, history, load_history
from gdfe_ros.solver.descent.search import ENERGY_ROUNDING
from gdfe_ros.solver.elements.barrier import tell_flat
from gdfe_ros.solver.elements.measures import LEAST_SCALE, MOST_SCALE, update_hourglass_scales
from gdfe_ros.solver.elements.response import Watch
from gdfe_ros.solver.equilibrium.predictor import Prediction
from gdfe_ros.solver.forces.actuation import Actuation, handle_reactions
from gdfe_ros.solver.forces.pressures import Pressures, store_energies
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.minimise.minimiser import Minimiser, Task
from gdfe_ros.solver.outcome import Outcome, join, past, tell
from gdfe_ros.solver.solution import Increment, Solution
from gdfe_ros.solver.state import ElementState, State, Summary, Unfinished
from gdfe_ros.solver.vectors import Array


@dataclass(frozen=True, eq=False)
class Model:
    """Data common to all solves of a body: body, external terms, kinematics of its handles, and minimiser.

    Attributes:
        active: the active set of the whole body.
        threads: number of threads that evaluate the elements; None stands for the calling thread alone.
        moving: whether inertia is among the terms.
    """

    body: Body
    actuation: Actuation
    handles: HandleMotions
    minimiser: Minimiser
    active: ActiveSet
    threads: int | None
    moving: bool


class Solve:
    """A solve in progress.

    Args:
        model: data common to all solves.
        problem: the requested increment.
        start: state at the beginning.
        predicted: positions at which the first minimisation begins.

    Attributes:
        problem, start: the arguments.
        pressures: the elements' pressures, multipliers of their volumes.
        iterations: number of iterations of the last call of `descend`.
    """

    FIRST_TOLERANCE, TIGHTEN = 1e-2, 0.1
    """If multipliers are updated: tolerance of the first minimisation, and ratio of successive tolerances."""
    LINEAR = 1e-4
    """Coarsest tolerance of the last minimisation in statics. Farther from the equilibrium, the length of a step is no
    reliable estimate of the distance, because the bending stiffness of a sheet or a hanging bar changes within a
    displacement of one thickness.
    """
    FAINT = 0.3
    """If the error of a constraint, or the change of an hourglass scale, exceeds this multiple of the tolerance, a
    further minimisation must confirm that the positions are within the tolerance. (With a single cell across, the
    whole bending stiffness depends on the scale.)
    """
    LAGGING_VOLUME, LAGGING_SCALE = 10.0, 100.0
    """In motion: allowed errors of volumes, and allowed changes of hourglass scales in the last update, both divided by
    the tolerance. The updates of the next step reduce these errors.
    """
    SLOW = 10
    """The tolerance is reduced each time after this number of updates at the finest tolerance without settled
    constraints.
    """
    MOST_UPDATES = 200
    """Largest number of updates of pressures, multipliers and scales in one solve. Confined, incompressible bodies need
    most updates.
    """
    COARSE = 0.02
    """Excess volume at the corners of hexahedra, divided by the volume of the body, above which a message says that the
    cells are too coarse. It is at most 0.004 in the shipped scenes, and 0.05 in a bar that twists because of it.
    """

    def __init__(self, model: Model, problem: Increment, start: State, predicted: Prediction) -> None:
        self._minimiser, self._body, self._actuation = model.minimiser, model.body, model.actuation
        self._active, self._threads, self._moving = model.active, model.threads, model.moving
        self.problem, self.start, self._predicted, self._from = problem, start, predicted, predicted.state
        self._frame, self._watch = model.handles.frame(self._from.base), Watch.over(len(self._body.material))
        self._operators = self._actuation.growths.at(problem.commands, start.operators)
        same = start.poses == problem.poses and start.commands == problem.commands
        self._resumed = start.unfinished if same else None
        self.iterations, ratio, elements = 0, predicted.ratio, start.elements
        self.pressures = Pressures(self._body, elements, ratio)
        last, before = elements.hourglass_scale, elements.hourglass_scale_before
        self._scale = np.clip(last + ratio * (last - before), LEAST_SCALE, MOST_SCALE)
        given = self._from.positions, problem.poses, start
        self._actuation.begin(problem.commands, start.terms, *given, ratio=ratio)

    @property
    def final_tolerance(self) -> float:
        """Tolerance of the final minimisation."""
        return self.problem.tolerance if self._moving else min(self.problem.tolerance, self.LINEAR)

    @property
    def interrupted(self) -> bool:
        """Whether the solve continues an earlier one: the previous part of a load path, or a solve that was cut."""
        return self.problem.begins > 0.0 or self._resumed is not None

    @classmethod
    def at(cls, model: Model, state: State) -> Solve:
        """Return a solve that begins exactly at a state."""
        problem = Increment.at(state, tolerance=1.0, limit=0)
        return cls(model, problem, state, Prediction(state, 0.0))

    def go_on_from(self, state: State) -> None:
        """Let the next minimisation start from ``state``, a state that this solve has found; multipliers stay."""
        self._from = state
        self.pressures.begin()

    def task_at(self, state: State) -> Task:
        """Do `go_on_from`, and evaluate all terms at ``state``; return the minimisation's task."""
        self.go_on_from(state)
        return self.evaluate()

    def evaluate(self) -> Task:
        """Set the unknowns to the start and evaluate all terms there; return the minimisation's task."""
        task = self._set_start()
        task.evaluate()
        return task

    def _set_start(self) -> Task:
        """Set the unknowns to the start; return the minimisation's task."""
        active = self._active
        problem = Problem(
            self._operators.shape,
            self._operators.blocks if self._actuation.growths else active.blocks,
            self._body.material,
            self.pressures.values,
            self._scale,
            self.pressures.table,
            self._watch,
            active.unknowns,
            self._frame,
            self._actuation.table,
            self._threads,
        )
        active.place(self._from.positions, self._from.base, self._from.slides, self._from.turns)
        self._watch.room[...] = -1.0
        runs_away = self._runs_away if self.problem.divisible else None
        return Task(active, problem, self.problem.deadline, runs_away)

    def _runs_away(self, positions: Array) -> bool:
        """Return whether an actuator is beyond its limit point since the last equilibrium."""
        last = self.start.anchor or self.start
        return self._actuation.unstable(positions, last.positions, self.problem.commands) is not None

    def descend(self, *, spent: int = 0) -> Solution:
        """Minimise and update multipliers in turn, until the constraints are satisfied; return the solution.

        ``spent`` is the number of iterations that the solve has made before this call.
        """
        active, limit = self._active, self.problem.limit - spent
        self._minimiser.begin(active, self._from.tangent)
        if self._resumed is not None and not self.iterations:
            load_history(active.workspace, self._resumed.steps, self._resumed.changes)
        task = self._set_start()
        updates = bool(len(active.carried) or len(active.softening) or self._actuation.updates)
        self._present, self._finest = self._first_tolerance(updates=updates), self.final_tolerance
        self._settled, self._exact, self.iterations, self._cut = not updates, 0, 0, False
        for _ in range(self.MOST_UPDATES):
            confirms = updates and self._settled
            tolerance, left = self.final_tolerance if confirms else self._present, limit - self.iterations
            went = self._minimiser.descend(task, tolerance=tolerance, limit=left, proven=confirms)
            self.iterations, self._cut = self.iterations + went, active.ended is Outcome.CUT
            if not updates or self._has_failed():
                break
            exact = tolerance <= self._present <= self.final_tolerance
            if self._balance(exact, still=went == 0) or self._actuation.wanders:
                break
            self._present = max(self._finest, self.TIGHTEN * self._present)
            if self.iterations >= limit or (self.iterations and past(self.problem.deadline)):
                self._cut = True
                break
        return self._solution()

    def _first_tolerance(self, *, updates: bool) -> float:
        """Return the tolerance of the first minimisation; a resumed solve uses that of the interrupted one."""
        if self._resumed is not None:
            return max(self._resumed.tolerance, self.final_tolerance)
        coarse = updates and not self._predicted.ratio
        return max(self.FIRST_TOLERANCE, self.final_tolerance) if coarse else self.final_tolerance

    def _has_failed(self) -> bool:
        """Return whether the last minimisation failed, so that updates of multipliers are useless."""
        ended = self._active.ended
        if ended in (Outcome.STALLED, Outcome.EXHAUSTED):
            return bool(self._active.status["blocked"])
        return ended in (Outcome.RUNAWAY, Outcome.GIVEN_UP, Outcome.CUT)

    def _balance(self, exact: bool, *, still: bool) -> bool:
        """Update pressures, multipliers and scales, unless they have settled; return whether the solve ends.

        In statics, the solve ends if the last update was negligible (`FAINT`), or if the minimisation after it made no
        iteration (``still``). In motion, the solve ends after the first update that satisfies the constraints.
        ``exact`` is True if the minimisation had the tolerance of the solve or a finer one.
        """
        if still and self._settled:  # the last update has not moved the equilibrium
            return True
        # Even if no further descent is possible, new pressures and scales may make one possible.
        last = exact or self._active.ended is not Outcome.NEAR
        error, change = self._update(still=still)
        kept = 1.0 if self._moving or self._actuation.contacts else self.FAINT
        self._settled = last and error <= kept
        self._exact += last
        if last and not self._settled and (still or self._exact % self.SLOW == 0):
            self._finest *= self.TIGHTEN  # the positions are not accurate enough for the constraints
        faint = max(error, change) <= self.FAINT and not self._actuation.contacts
        return self._settled and (still or faint or self._moving)

    def _solution(self) -> Solution:
        """Return the solution at the end of the last minimisation."""
        active, start, problem, body = self._active, self.start, self.problem, self._body
        if self._minimiser.ran_away(active, start.positions):
            state = start.with_flaw(tell(Outcome.RUNAWAY), error_estimate=np.inf)
            ended = {"ended": Outcome.RUNAWAY, "began": start.positions}
            return Solution(state=state, iterations=self.iterations, **ended)
        work, stored, least = active.workspace, np.zeros(len(body.material)), np.ones(len(body.material))
        given = work.x, active.elements, self._operators.shape, body.material, self.pressures.table
        excess = store_energies(*given, self.pressures.values, work.energies, stored, least, True)
        positions, (slides, turns) = work.x.copy(), active.rigid_motion()
        outcome, estimate = self._judge()
        flaw, message = self._actuation.flaw(positions), self._explain(outcome, estimate)
        converged = outcome is Outcome.NEAR and not flaw and bool(least.min() > 0.0)
        message = join(flaw, message, self._tell_coarse(excess) if converged else tell_flat(least))
        terms = self._actuation.finish(start.terms, positions, moving=self._moving)  # before contacts give reactions
        outside = work.outside if self._actuation.terms else None
        others = self._actuation.contacts, self._actuation.grips
        summary = Summary(
            converged=converged,
            error_estimate=estimate,
            energy=float(stored.sum()),
            min_det=float(least.min()),
            reactions=handle_reactions(body, positions, work.force, outside, *others),
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
                base=self._from.base,
                poses=problem.poses,
                commands=problem.commands,
                slides=slides,
                turns=turns,
                terms=terms,
                elements=elements,
                operators=self._operators,
                balance=self._actuation.balance(positions, problem.commands) if energetic else None,
                tangent=self._minimiser.keep_tangent(),
                unfinished=self._keep_unfinished() if self._cut and not converged else None,
                summary=summary,
            ),
            iterations=self.iterations,
            ended=Outcome.NEAR if converged else Outcome.CUT if self._cut else active.ended,
            entered=bool(flaw),
            began=self._predicted.state.positions,
        )

    def _update(self, *, still: bool) -> tuple[float, float]:
        """Update pressures, multipliers and scales.

        Returns:
            The largest error of a constraint and the largest change of an hourglass scale, both divided by the
            tolerance.
        """
        active, body, shape = self._active, self._body, self._operators.shape
        x, errors, change = active.workspace.x, [0.0], 0.0
        tolerance = self.problem.keeping or self.problem.tolerance
        if len(active.carried):
            wrong = self.pressures.update(x, active.carried, shape, still=still)
            errors.append(wrong / (self.problem.volumes or tolerance * (self.LAGGING_VOLUME if self._moving else 1.0)))
        if self._actuation.updates:
            errors.append(self._actuation.update(x) / tolerance)
        if len(active.softening):
            given = x, active.softening, shape, body.material, body.table, self._scale
            change = update_hourglass_scales(*given) / tolerance
        if self._moving:
            errors.append(change / self.LAGGING_SCALE)
        return float(np.max(errors)), change

    def _judge(self) -> tuple[Outcome, float]:
        """Return the outcome of the solve (`Outcome.NEAR` at an equilibrium), and the error estimate."""
        active, tolerance = self._active, self.problem.tolerance
        estimate, forces = self._minimiser.error_estimate(active), self._minimiser.contact_forces
        drowned = ENERGY_ROUNDING * float(active.status["outside"])
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

    def _explain(self, outcome: Outcome, estimate: float) -> str:
        """Return a message about the defect of a solve that ended with ``outcome``."""
        late, problem = self._cut and past(self.problem.deadline), self.problem
        return tell(
            outcome,
            estimate=estimate,
            tolerance=problem.tolerance,
            reason=problem.deadline.reason if late else f"stopped after {problem.limit} iterations",
            far=float(self._active.status["step"]) / self._body.size,
            updates=self.MOST_UPDATES,
            where=self._minimiser.contact_forces.tell_worst() if outcome is Outcome.PUSHED else "",
        )

    def _tell_coarse(self, excess: float) -> str:
        """Return a message if the hexahedra do not follow their corners, which have an ``excess`` volume [m^3]."""
        share = excess / self._operators.shape.volume.sum() if self._body.cell_type.softens else 0.0
        if share <= self.COARSE:
            return ""
        return (
            f"the cells are too coarse for this deformation: their corners have {100.0 * share:.2g} % more volume than "
            "their mean deformation gradients, and a stretched body may twist; remedy: cells along the stretch of at "
            "most a quarter of the section's width, or tetrahedra"
        )

    def _keep_unfinished(self) -> Unfinished:
        done = self._resumed.iterations if self._resumed else 0
        steps, changes = history(self._active.workspace)
        return Unfinished(tolerance=self._present, iterations=done + self.iterations, steps=steps, changes=changes)
