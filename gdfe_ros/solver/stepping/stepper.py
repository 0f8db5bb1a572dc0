# SPDX-License-Identifier: Apache-2.0
"""Steps from a state to the equilibrium at new commands, in increments, with retries if the increments fail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import Deadline, past
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.forces.actuation import Actuation, past_limit
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.outcome import REMEDY_OF_FOLDS, Outcome, join, tell
from gdfe_ros.solver.settings import Skip, SolverSettings
from gdfe_ros.solver.solution import Increment, Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.march import March, crumpled
from gdfe_ros.solver.stepping.path import Attempt, Goal, LoadPath, Verdict, jumped, planned_increments
from gdfe_ros.solver.stepping.placing import placed, require_own
from gdfe_ros.solver.value import changed


class Equilibrium(Protocol):
    """What a stepper needs of a solver of equilibria.

    Attributes:
        handles: the kinematics of the handles.
        patience: number of iterations after which a solve is given up and a shorter increment is tried.
    """

    handles: HandleMotions
    patience: int

    def at_rest(self) -> State:
        """Return the undeformed state."""

    def solve(self, problem: Increment, start: State) -> Solution:
        """Find the equilibrium of ``problem`` from ``start``, which is not modified."""

    def accept(self, solution: Solution, previous: State) -> State:
        """Return the complete state of ``solution``, which follows the state ``previous``."""

    def skipped(self) -> dict[str, int]:
        """Return a dict from kind of work to the count that each solve leaves out, as in `StepResult`."""


class Stepper:
    """Computes the equilibria at successive commands. It stores no state.

    Args:
        body: the discretised body.
        settings: settings of the solver.
        actuation: the external terms; None if there are none.
        equilibrium: another solver of equilibria, instead of that of the policy ``energy``.

    Attributes:
        equilibrium: the solver of equilibria.
    """

    FINER = 1e-2
    """Factor of the tolerance for a body with freely rotating handles. At the full tolerance, unbalanced forces are
    large compared with the handles' moments.
    """

    def __init__(
        self,
        body: Body,
        settings: SolverSettings,
        actuation: Actuation | None = None,
        equilibrium: Equilibrium | None = None,
    ) -> None:
        self.body, self._settings = body, settings
        self.actuation = actuation or Actuation(body)
        options = {"skip": settings.skip, "threads": settings.threads}
        self.equilibrium = equilibrium or EquilibriumSolver(body, self.actuation, **options)

    def at_rest(self) -> State:
        """Return the undeformed state, with neutral commands."""
        return self.equilibrium.at_rest()

    def rests(self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> bool:
        """Return whether ``state`` already is the equilibrium at these commands, so that no solve is needed."""
        settled = state.poses == targets and state.commands == commands
        return settled and state.summary.converged and Skip.SOLVE in self._settings.skip

    def settled(self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> bool:
        """Return whether a state does not change at these commands: it is an equilibrium."""
        return state.summary.converged

    def started(self, state: State, commands: Mapping[str, float]) -> State:
        """Return ``state``: equilibria do not depend on the beginning of a motion."""
        return state

    def step(
        self,
        state: State,
        targets: Mapping[str, Pose],
        commands: Mapping[str, float],
        *,
        duration: float = 0.0,
        tolerance: float | None = None,
        deadline: Deadline | None = None,
    ) -> March:
        """Return the outcome of following the load path from ``state`` to the commands.

        Args:
            state: state at the beginning; it is not modified.
            targets: pose of every handle.
            commands: command of every actuator and load.
            duration: duration [s]; an equilibrium does not depend on it.
            tolerance: tolerance; None stands for the tolerance of the settings.
            deadline: once it has passed, the step ends with the state that it has reached.
        """
        tolerance = tolerance or self._settings.tolerance * (self.FINER if self.equilibrium.handles.turn else 1.0)
        goal = Goal(poses=dict(targets), commands=dict(commands), tolerance=tolerance, deadline=deadline)
        if unreachable := self._unreachable(state, goal):
            return March.refused(state, unreachable)
        march, suspect = self._rescued(self._march(state, goal), goal, state), state.suspect
        if suspect and not past(deadline):
            march, suspect = self._better_from_rest(march, goal), False
        if march.inverted:
            march = changed(march, converged=False, message=join(march.message, REMEDY_OF_FOLDS))
        return march.marked(suspect=suspect)

    def _rescued(self, march: March, goal: Goal, state: State) -> March:
        """Return ``march``, or the outcome of a better load path if this one from ``state`` gave up or is doubtful."""
        unfinished, deadline = march.state.unfinished, goal.deadline
        given_up = unfinished is None or max(march.iterations, unfinished.iterations) >= self.equilibrium.patience
        doubtful = crumpled(state) or crumpled(march.state) or not march.sound
        if given_up and state.anchor is not None and doubtful and not past(deadline):
            # The state of an unfinished solve leads to a failure, or is crumpled and leads to higher energy.
            # Try again from the last equilibrium.
            again = self._march(state.anchor, goal)
            lower = not march.sound or self._energy(again.state) < self._energy(march.state)
            march = (again if again.sound and lower else march).counting(march, again)
        if given_up and not (march.sound or (march.snapped and march.reached) or past(deadline)):
            march = self._let_go(march, goal, state)
        return march

    def place(self, state: State, positions: NDArray[np.float64]) -> State:
        """Return a state at ``positions`` (n, 3) [m]; the handles stay at their commanded poses.

        Pressures, captured shapes and the last motion are reset. If an element is folded or inverted there, the next
        step may end in another minimum of the energy. Its result is then compared with the load path from the
        undeformed body.
        """
        there = placed(self.body, self.equilibrium.handles, state, positions, afresh=self.at_rest())
        return there.with_(suspect=not there.sound)

    def carried(self, state: State, before: State) -> State:
        """Return ``state``: equilibria have no account of energies."""
        return state

    def completed(self, state: State) -> State:
        """Return a state that was read from an archive, with the operators that follow from its commands.

        A state that converged only to a larger tolerance is marked as not converged.
        """
        require_own(state, self.at_rest())
        growths, summary = self.actuation.growths, state.summary
        summary = changed(summary, converged=summary.converged and summary.error_estimate <= self._settings.tolerance)
        anchor = None if state.anchor is None else self.completed(state.anchor)
        operators = growths.at(state.commands, growths.ungrown)
        return state.with_(operators=operators, anchor=anchor, summary=summary)

    def velocities(self, state: State) -> None:
        """Return None: equilibria have no velocity."""

    def energies(self, state: State) -> dict[str, float]:
        """Return no energies beyond those of the summary."""
        return {}

    def _unreachable(self, state: State, goal: Goal) -> str:
        """Return a message if a cable is commanded shorter than the distance between its handles; empty if not."""
        if not self.actuation.strung:
            return ""
        base = self.equilibrium.handles.base(goal.poses, state.poses, state.base)
        return self.actuation.unreachable(base, goal.commands)

    def _march(self, state: State, goal: Goal) -> March:
        """Return the outcome of the load path from ``state`` to a goal; increments are halved after failed attempts."""
        centres = self.equilibrium.handles.centres_together(state.poses, goal.poses)
        together = () if self.actuation.contacts else centres  # nothing is in the way
        planned = planned_increments(goal.poses, state.poses, self.body.size, together=together)
        path, begin = LoadPath.between(state, goal, planned, self._settings.max_iterations, centres), state
        while True:
            attempt = self._attempt(path, state)
            verdict = attempt.verdict
            path = attempt.path.after(verdict)
            if verdict is Verdict.WITHDRAW:
                return self._end(_withdrawn(state, attempt), path)
            if verdict in (Verdict.ACCEPT, Verdict.STOP):
                state = self._accepted(state, attempt, begin)
            if verdict is Verdict.STOP:
                return changed(self._end(state, path), snapped=attempt.snapped)

    def _attempt(self, path: LoadPath, state: State) -> Attempt:
        """Solve the next increment of a load path; return the attempt."""
        (poses, commands), deadline, patience = path.aim, path.goal.deadline, self.equilibrium.patience
        limit = path.left if path.shortest else min(path.left, patience)
        problem = Increment(
            poses=poses,
            commands=commands,
            tolerance=path.goal.tolerance,
            limit=limit,
            deadline=deadline,
            begins=path.done,
            divisible=not path.shortest,
        )
        solution = self.equilibrium.solve(problem, state)
        spent = path.iterations + solution.iterations >= path.budget or past(deadline)
        jumps = path.moves and jumped(state, solution, self.equilibrium.handles, self.body.size)
        path, before = path.tried(solution, jumps=jumps), state.unfinished.iterations if state.unfinished else 0
        patient = before + path.iterations < patience
        unstable = "" if solution.cut and patient else self._unstable_chamber(state, solution, commands)
        return Attempt(
            path=changed(path, unstable=unstable or path.unstable),
            began=state,
            solution=solution,
            jumps=jumps,
            unstable=unstable,
            spent=spent,
            patient=patient,
        )

    def _unstable_chamber(self, state: State, solution: Solution, commands: Mapping[str, float]) -> str:
        """Return the name of a chamber that lost its stability in a failed attempt; empty for none."""
        if solution.converged:
            return ""
        before = state.commands if solution.diverged else None
        since = (state.anchor or state).positions
        return self.actuation.unstable(solution.positions, since, commands, before)

    def _accepted(self, state: State, attempt: Attempt, begin: State) -> State:
        """Return the state of an accepted attempt; it has a `State.anchor` if the load path fails.

        A load path fails if the solve is unfinished, or if the path stops before its end with elements folded or nearly
        folded. The anchor is then the last equilibrium. If the elements of this equilibrium are folded or nearly
        folded, the equilibrium at the beginning of the load path is preferred, or that before an unfinished beginning.
        """
        accepted = self.equilibrium.accept(attempt.solution, state)
        before = [each for each in (state, begin, begin.anchor) if each and each.unfinished is None and each.sound]
        before.sort(key=crumpled)
        crumples = attempt.verdict is Verdict.STOP and attempt.path.next < 1.0 and crumpled(accepted)
        fails = accepted.unfinished is not None or crumples
        anchor = state.anchor or next(iter(before), None) if fails else None
        changes = {"sound": attempt.sound, "anchor": anchor}
        if attempt.snapped:
            remedy = past_limit(self.actuation.actuators, attempt.began.commands, attempt.path.aim[1])
            message = join(tell(Outcome.SNAPPED), remedy, accepted.summary.message)
            changes["summary"] = changed(accepted.summary, converged=False, message=message)
        return accepted.with_(**changes)

    def _end(self, state: State, path: LoadPath) -> March:
        reached, summary = path.done == 1.0, state.summary
        if not reached and summary.converged:
            deadline = path.goal.deadline
            ended = deadline.reason if past(deadline) else f"{path.iterations} iterations are spent"
            text = tell(Outcome.STOPPED, reason=ended, done=path.done)
            summary = changed(summary, converged=False, message=text)
            state = state.with_(summary=summary)
        if path.folded and not (summary.converged and reached) and tell(Outcome.FOLDED) not in summary.message:
            text = join(summary.message, tell(Outcome.PRESSED))
            summary = changed(summary, converged=False, message=text)
            state = state.with_(summary=summary)
        return March(
            state=state,
            iterations=path.iterations,
            increments=path.attempts,
            reached=reached,
            converged=summary.converged and reached,
            message=summary.message,
            skipped=self.equilibrium.skipped(),
        )

    def _let_go(self, march: March, goal: Goal, start: State) -> March:
        """Retry with the moving obstacles at their targets and without contact forces; return the accepted outcome.

        The first attempt starts from the present state, the second from the undeformed body. A result is accepted only
        if these obstacles do not touch the body there: otherwise an obstacle might have passed through the body. If no
        result is accepted, ``march`` is returned.
        """
        flaw, touched = march.message, [contact.name for contact in self.actuation.contacts if contact.on_body]
        touched = [name for name in touched if march.state.terms[name]["press"].any()]
        names = [name for name in touched if start.poses[name] != goal.poses[name]]
        for begin in (march.state, self.at_rest()) if names else ():
            found = self._march(self._untouched(begin, march.state, names, goal), goal)
            free = found.sound and not any(found.state.terms[name]["press"].any() for name in names)
            march = (found if free else march).counting(march, found)
            if free:
                return changed(march, message=tell(Outcome.LET_GO, names=", ".join(names), flaw=flaw), restarts=1)
        return march

    def _untouched(self, begin: State, last: State, names: Sequence[str], goal: Goal) -> State:
        """Return ``begin`` with the obstacles ``names`` at their targets, without contact forces."""
        there = self.place(begin, begin.positions)
        rubbed = {contact.name: last.terms[contact.name]["lost"] for contact in self.actuation.contacts}
        lost = {name: {**there.terms[name], "lost": heat} for name, heat in rubbed.items()}
        poses = {**begin.poses, **{name: goal.poses[name] for name in names}}
        return there.with_(poses=poses, terms={**there.terms, **lost})

    def _better_from_rest(self, march: March, goal: Goal) -> March:
        """Return the better of ``march`` and the load path from the undeformed body; the latter gets a message."""
        again = self._march(self.at_rest(), goal)
        gain = self._energy(march.state) - self._energy(again.state)
        if not again.is_better(march, March.NEAR * goal.tolerance * self.body.size, gain=gain):
            return march.counting(march, again)
        message = join(tell(Outcome.RESTARTED, flaw=march.flaw), again.message)
        return changed(again.counting(march, again), message=message, restarts=1)

    def _energy(self, state: State) -> float:
        """Return the energy of the body plus the potential of the terms [J], which an equilibrium minimises."""
        return state.summary.energy + self.actuation.balance(state.positions, state.commands).potential


def _withdrawn(state: State, attempt: Attempt) -> State:
    """Return the last sound state, with the reason why the step returns to it."""
    sound = state.anchor or state
    summary = changed(sound.summary, converged=False, message=attempt.reason_to_withdraw)
    return sound.with_(summary=summary)
