# SPDX-License-Identifier: Apache-2.0
"""Steps from a state to the equilibrium at new commands, in increments, with retries if the increments fail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gdfe_ros.actuators import Actuator
from gdfe_ros.constraints import Pose
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.barrier import THRESHOLD
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.forces.actuation import Actuation, past_limit
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.outcome import REMEDY_OF_FOLDS, Deadline, Outcome, join, past, tell
from gdfe_ros.solver.settings import Skip, SolverSettings
from gdfe_ros.solver.solution import Increment, PathResult, Solution, is_crumpled
from gdfe_ros.solver.state import State, replace_fields
from gdfe_ros.solver.stepping.path import Attempt, LoadPath, Verdict, count_increments, has_jumped
from gdfe_ros.solver.vectors import Array


def place(body: Body, handles: HandleMotions, state: State, positions: Array, *, afresh: State) -> State:
    """Return a state at ``positions`` (n, 3) [m] with the handles at their commanded poses.

    Args:
        body: the discretised body.
        handles: the kinematics of its handles.
        state: the state from which the commands and the growth are taken.
        positions: positions of all vertices; a handle without free axes keeps its commanded positions, and the free
            motion of any other handle is fitted.
        afresh: the undeformed state, from which the initial pressures, captured shapes and motion are taken.
    """
    moved = positions.copy()
    slides, turns = handles.fit(moved, state.base)
    for handle in body.handles:
        own = handle.vertices
        if handle.slide is not None:
            moved[own] = np.where(handle.slide, moved[own], state.base[own])
        elif not handle.loose:
            moved[own] = state.base[own]
    least = float(least_volume_ratio(moved, state.operators.shape))
    return afresh.with_(
        positions=moved,
        base=state.base,
        poses=state.poses,
        commands=state.commands,
        slides=slides,
        turns=turns,
        operators=state.operators,
        balance=None,
        summary=replace_fields(state.summary, converged=False, min_det=least),
        sound=least > 0.0,
    )


class Stepper:
    """Computes the equilibria at successive commands. It stores no state.

    Args:
        body: the discretised body.
        settings: settings of the solver.
        actuation: the external terms; None if there are none.
        equilibrium: solver of equilibria of another policy, with the same methods; None for the policy ``energy``.

    Attributes:
        body, settings: the arguments.
        equilibrium: the solver of equilibria.
    """

    FINER = 1e-2
    """Factor of the tolerance for a body with freely rotating handles. With the full tolerance, the remaining forces
    would be large compared with the moments on these handles.
    """

    def __init__(
        self,
        body: Body,
        settings: SolverSettings,
        actuation: Actuation | None = None,
        equilibrium: EquilibriumSolver | None = None,
    ) -> None:
        self.body, self.settings = body, settings
        self.actuation = actuation or Actuation(body)
        options = {"skip": settings.skip, "threads": settings.threads}
        self.equilibrium = equilibrium or EquilibriumSolver(body, self.actuation, **options)

    def at_rest(self) -> State:
        """Return the undeformed state, with neutral commands."""
        return self.equilibrium.at_rest()

    def rests(self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> bool:
        """Return whether ``state`` already is the equilibrium at these commands, so that no solve is needed."""
        settled = state.poses == targets and state.commands == commands
        return settled and state.summary.converged and Skip.SOLVE in self.settings.skip

    def is_settled(self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> bool:
        """Return whether a state does not change at these commands: it is an equilibrium."""
        return state.summary.converged

    def start_motion(self, state: State, commands: Mapping[str, float]) -> State:
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
    ) -> PathResult:
        """Return the outcome of following the load path from ``state`` to the commands.

        Args:
            state: state at the beginning; it is not modified.
            targets: pose of every handle.
            commands: command of every actuator and load.
            duration: duration [s]; an equilibrium does not depend on it.
            tolerance: tolerance; None stands for the tolerance of the settings.
            deadline: once it has passed, the step ends with the state that it has reached.
        """
        tolerance = tolerance or self.settings.tolerance * (self.FINER if self.equilibrium.handles.turn else 1.0)
        wanted, limit = {"poses": dict(targets), "commands": dict(commands)}, self.settings.max_iterations
        goal = Increment(**wanted, tolerance=tolerance, limit=limit, deadline=deadline)
        if unreachable := self._unreachable(state, goal):
            return PathResult(state=state.with_flaw(unreachable), completed=False)
        result, suspect = self._rescue(self._follow(state, goal), goal, state), state.suspect
        if suspect and not past(deadline):
            result, suspect = self._better_from_rest(result, goal), False
        if result.inverted:
            result = result.with_message(join(result.message, REMEDY_OF_FOLDS), converged=False)
        return replace_fields(result, state=result.state.with_(suspect=suspect))

    def _rescue(self, result: PathResult, goal: Increment, state: State) -> PathResult:
        """Return ``result``, the outcome from ``state``, or a better outcome of a retry if it failed or is doubtful."""
        unfinished, deadline = result.state.unfinished, goal.deadline
        given_up = unfinished is None or max(result.iterations, unfinished.iterations) >= self.equilibrium.patience
        doubtful = is_crumpled(state) or is_crumpled(result.state) or not result.sound
        if given_up and state.anchor is not None and doubtful and not past(deadline):
            # The state of an unfinished solve leads to a failure, or is crumpled and leads to higher energy.
            # Try again from the last equilibrium.
            again = self._follow(state.anchor, goal)
            lower = not result.sound or self._energy(again.state) < self._energy(result.state)
            result = again.counting(result) if again.sound and lower else result.counting(again)
        if given_up and not (result.sound or (result.snapped and result.completed) or past(deadline)):
            result = self._let_go(result, goal, state)
        return result

    def place(self, state: State, positions: Array) -> State:
        """Return a state at ``positions`` (n, 3) [m]; the handles stay at their commanded poses.

        Pressures, captured shapes and the last motion are reset. If an element is folded or inverted there, the next
        step may end in another minimum of the energy. Its result is then compared with the load path from the
        undeformed body.
        """
        there = place(self.body, self.equilibrium.handles, state, positions, afresh=self.at_rest())
        return there.with_(suspect=not there.sound)

    def carry_energies(self, state: State, before: State) -> State:
        """Return ``state`` unchanged: equilibria have no energy account to take over from the state ``before``."""
        return state

    def velocities(self, state: State) -> None:
        """Return None: equilibria have no velocity."""

    def energies(self, state: State) -> dict[str, float]:
        """Return no energies: only a motion has an energy account."""
        return {}

    def _unreachable(self, state: State, goal: Increment) -> str:
        """Return a message if a cable's commanded length is below the distance of its fixed points; empty if not."""
        if not self.actuation.strung:
            return ""
        base = self.equilibrium.handles.base(goal.poses, state.poses, state.base)
        return self.actuation.unreachable(base, goal.commands)

    def _follow(self, state: State, goal: Increment) -> PathResult:
        """Return the outcome of the load path from ``state`` to a goal; failed attempts halve the increment."""
        centres = self.equilibrium.handles.centres_together(state.poses, goal.poses)
        together = () if self.actuation.contacts else centres  # nothing is in the way
        planned = count_increments(goal.poses, state.poses, self.body.size, together=together)
        path = LoadPath.over(state, goal, planned, budget=planned * goal.limit, centres=centres)
        while True:
            attempt = self._attempt(path)
            path, verdict = attempt.path, attempt.verdict
            if verdict is Verdict.HALVE:
                path = path.halve()
            elif verdict is Verdict.WITHDRAW:
                last = path.state.anchor or path.state
                return self._end(replace_fields(path, state=last.with_flaw(attempt.reason_to_withdraw)))
            else:
                path = path.advance(self._accept(attempt, stops=verdict is Verdict.STOP))
            if verdict is Verdict.STOP:
                return self._end(path, snapped=attempt.snapped)

    def _attempt(self, path: LoadPath) -> Attempt:
        """Solve the next increment of a load path; return the attempt."""
        (poses, commands), state, goal, patience = path.next_place, path.state, path.goal, self.equilibrium.patience
        limit = path.left if path.shortest else min(path.left, patience)
        wanted = {"poses": poses, "commands": commands, "limit": limit, "begins": path.covered}
        solution = self.equilibrium.solve(replace_fields(goal, **wanted, divisible=not path.shortest), state)
        sound = solution.min_det > 0.0
        pressed = not sound or (solution.min_det < THRESHOLD and not solution.converged)
        jumps = path.moves and has_jumped(state, solution, self.equilibrium.handles, self.body.size)
        path = path.record_attempt(solution, jumped=path.jumped or jumps, folded=path.folded or pressed)
        spent = path.iterations >= path.budget or past(goal.deadline)
        patient = path.iterations + (state.unfinished.iterations if state.unfinished else 0) < patience
        unstable = None if solution.cut and patient else self._find_unstable(state, solution, commands)
        return Attempt(
            path=replace_fields(path, unstable=unstable or path.unstable),
            solution=solution,
            jumps=jumps,
            unstable=unstable,
            spent=spent,
            patient=patient,
        )

    def _find_unstable(self, state: State, solution: Solution, commands: Mapping[str, float]) -> Actuator | None:
        """Return an actuator that lost its stability in a failed attempt; None if no actuator did."""
        if solution.converged:
            return None
        before = state.commands if solution.diverged else None
        since = (state.anchor or state).positions
        return self.actuation.unstable(solution.positions, since, commands, before)

    def _accept(self, attempt: Attempt, *, stops: bool) -> State:
        """Return the state of an accepted attempt; if the load path fails, the state gets a `State.anchor`.

        A load path fails if the solve is unfinished, or if the path stops before its end with elements folded or nearly
        folded. An anchor that the state already has stays. Otherwise there are three candidates, latest first: the
        state before the attempt, the state at the beginning of the load path, and the anchor of the latter. The anchor
        is the first candidate without folded or nearly folded elements; if all have such elements, it is the first one.
        """
        state, begin = attempt.path.state, attempt.path.began
        accepted = self.equilibrium.accept(attempt.solution, state)
        before = [each for each in (state, begin, begin.anchor) if each and each.unfinished is None and each.sound]
        before.sort(key=is_crumpled)
        fails = accepted.unfinished is not None or (stops and attempt.path.next < 1.0 and is_crumpled(accepted))
        anchor = state.anchor or next(iter(before), None) if fails else None
        if attempt.snapped:
            remedy = past_limit(self.actuation.actuators, state.commands, attempt.path.next_place[1])
            accepted = accepted.with_flaw(join(tell(Outcome.SNAPPED), remedy, accepted.summary.message))
        return accepted.with_(sound=attempt.sound, anchor=anchor)

    def _end(self, path: LoadPath, *, snapped: bool = False) -> PathResult:
        """Return the outcome of a load path that has ended, with the reason if it ended before its command."""
        state, deadline = path.state, path.goal.deadline
        if not path.completed and state.summary.converged:
            ended = deadline.reason if past(deadline) else f"{path.iterations} iterations are spent"
            state = state.with_flaw(tell(Outcome.STOPPED, reason=ended, done=path.covered))
        message = state.summary.message
        if path.folded and not state.summary.converged and tell(Outcome.FOLDED) not in message:
            state = state.with_flaw(join(message, tell(Outcome.PRESSED)))
        return replace_fields(path, state=state).result(self.equilibrium.count_skipped(), snapped=snapped)

    def _let_go(self, result: PathResult, goal: Increment, start: State) -> PathResult:
        """Retry with the moving obstacles at their targets and without contact forces; return the accepted outcome.

        The first attempt starts from the state of ``result``, the second from the undeformed body. A result is accepted
        only if these obstacles do not touch the body there: otherwise an obstacle might have passed through the body.
        If no result is accepted, ``result`` is returned.
        """
        flaw, touched = result.message, [contact.name for contact in self.actuation.contacts if contact.on_body]
        touched = [name for name in touched if result.state.terms[name]["press"].any()]
        names = [name for name in touched if start.poses[name] != goal.poses[name]]
        for begin in (result.state, self.at_rest()) if names else ():
            found = self._follow(self._drop_forces(begin, result.state, names, goal), goal)
            free = found.sound and not any(found.state.terms[name]["press"].any() for name in names)
            result = found.counting(result) if free else result.counting(found)
            if free:
                text = tell(Outcome.LET_GO, names=", ".join(names), flaw=flaw)
                return replace_fields(result.with_message(text, converged=True), restarts=1)
        return result

    def _drop_forces(self, begin: State, last: State, names: Sequence[str], goal: Increment) -> State:
        """Return ``begin`` with the obstacles ``names`` at their targets, without contact forces."""
        there = self.place(begin, begin.positions)
        rubbed = {contact.name: last.terms[contact.name]["lost"] for contact in self.actuation.contacts}
        lost = {name: {**there.terms[name], "lost": heat} for name, heat in rubbed.items()}
        poses = {**begin.poses, **{name: goal.poses[name] for name in names}}
        return there.with_(poses=poses, terms={**there.terms, **lost})

    def _better_from_rest(self, result: PathResult, goal: Increment) -> PathResult:
        """Return the better of ``result`` and the outcome from the undeformed body; a message marks the latter."""
        again = self._follow(self.at_rest(), goal)
        gain = self._energy(result.state) - self._energy(again.state)
        if not again.is_better(result, PathResult.NEAR * goal.tolerance * self.body.size, gain=gain):
            return result.counting(again)
        described = again.with_message(
            join(tell(Outcome.RESTARTED, flaw=result.flaw), again.message), converged=again.converged
        )
        return replace_fields(described.counting(result), restarts=1)

    def _energy(self, state: State) -> float:
        """Return the energy of the body plus the potential of the terms [J], which an equilibrium minimises."""
        return state.summary.energy + self.actuation.balance(state.positions, state.commands).potential
