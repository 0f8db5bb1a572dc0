# SPDX-License-Identifier: Apache-2.0
"""Time steps of a body with mass. Each step consists of internal steps, whose end positions minimise a potential."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy import sparse

from gdfe_ros.constraints import Pose
from gdfe_ros.materials.table import SHEAR
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.motion import inertia
from gdfe_ros.solver.motion.impulse import ContactImpulses
from gdfe_ros.solver.motion.inertia import FreeMass, Inertia
from gdfe_ros.solver.motion.ledger import Accounts, tell_excess
from gdfe_ros.solver.motion.scheme import Kinematics
from gdfe_ros.solver.motion.time_path import (
    InternalStep,
    MotionPredictor,
    TimePath,
    Trial,
    has_failed,
    is_unfolded,
    reduction,
)
from gdfe_ros.solver.motion.viscosity import Viscosity, unrelaxed
from gdfe_ros.solver.outcome import Deadline, past
from gdfe_ros.solver.settings import BackwardEuler, Dynamics, Scheme, Skip, SolverSettings
from gdfe_ros.solver.solution import Increment, PathResult, Solution
from gdfe_ros.solver.state import State, replace_fields
from gdfe_ros.solver.stepping.path import Verdict
from gdfe_ros.solver.stepping.stepper import place
from gdfe_ros.solver.terms.term import Term
from gdfe_ros.solver.vectors import NEGLIGIBLE, Array, largest


class MotionStepper:
    """Steps a body with mass in time. It stores no state, only factors for the step lengths in use.

    Args:
        body: the discretised body.
        settings: settings of the solver.
        dynamics: scheme and damping.
        mass: (n, n) its mass matrix [kg].
        acting: function that returns the actuation with given additional terms.

    Attributes:
        body, settings: the arguments.
        equilibrium: equilibrium solver of internal steps of the longest length.
        actuation: the external terms of these internal steps.
        mass: the argument.
        free_mass: the mass of the free vertices.
    """

    CALM = 0.5
    """A body counts as at rest if no vertex, at its present velocity or acceleration, moves farther than the tolerance
    within this time [s].
    """
    RELAXED = 3.0
    """The time in `CALM` is at least this number times the longest relaxation time of the body."""
    HELD = 3.0
    """Factor in the tolerance of internal steps of a body with handles and without rigid bodies. The displacement from
    which `reduction` computes the tolerance of such a body also includes h |v|. Free bodies need the smaller tolerance,
    because only the accuracy of the solve conserves their momentum. Without numerical damping (`newmark`) the factor is
    1.
    """
    UNRELAXED = 0.01
    """Largest strain in a branch of the Prony series of a body at rest, divided by the tolerance."""
    KEPT = 8
    """Largest number of pairs of a scheme and a step length whose factors are kept."""
    SHORTEST = 1e-2
    """Durations below this fraction of the longest internal step are not simulated, but added to the next step. In so
    short a time, the computed acceleration would be noise.
    """

    def __init__(
        self,
        body: Body,
        settings: SolverSettings,
        dynamics: Dynamics,
        mass: sparse.csr_matrix,
        acting: Callable[[Sequence[Term]], Actuation],
    ) -> None:
        self.body, self.settings, self._dynamics, self.mass = body, settings, dynamics, mass
        self.free_mass = FreeMass(body, mass)
        self._euler, self._acting = BackwardEuler.of(dynamics), acting
        self._made: dict[tuple[bool, float], EquilibriumSolver] = {}
        self.equilibrium = self.equilibrium_of(dynamics, dynamics.step)
        self.actuation = self.equilibrium.actuation
        self._accounts = Accounts(body, mass, dynamics, self.equilibrium.handles, settings.tolerance)
        # Pressures that lag behind a motion add energy to it; without damping they must not lag.
        self._fed = dynamics.scheme is not Scheme.BDF2 and not (dynamics.damps or dynamics.damping.mass)
        self._held = bool(body.handles) and not body.rigid_bodies
        self._coarser = 1.0 if dynamics.undamped else self.HELD
        self._calm = max(
            self.CALM, self.RELAXED * dynamics.relaxation(body.table.parameters[body.material][:, SHEAR].min())
        )

    def equilibrium_of(self, dynamics: Dynamics, h: float) -> EquilibriumSolver:
        """Return the equilibrium solver of internal steps of length ``h`` [s]."""
        key = dynamics.restarts, h
        if key in self._made:
            return self._made[key]
        own = [Inertia(self.body, self.mass, dynamics, h)]
        if dynamics.damps:
            own.append(Viscosity(self.body, dynamics, h))
        masses = np.asarray(self.mass.sum(axis=1)).ravel()
        while len(self._made) >= self.KEPT:
            del self._made[next(iter(self._made))]
        self._made[key] = EquilibriumSolver(
            self.body,
            self._acting(own),
            skip=self.settings.skip,
            threads=self.settings.threads,
            predictor=lambda *given: MotionPredictor(self.body, *given, h, masses),
            softening=not self._dynamics.undamped,
        )
        return self._made[key]

    def at_rest(self) -> State:
        """Return the initial state: the rest shape with the initial velocities of the scene."""
        return self.equilibrium.at_rest().with_(ledger=self._accounts.open_ledger())

    def rests(self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> bool:
        """Return whether a body with handles is at rest and would stay at rest at these commands."""
        same = state.poses == targets and state.commands == commands and state.summary.converged
        if not (same and Skip.SOLVE in self.settings.skip and self.body.handles and self._began(state)):
            return False
        now, near = self._accounts.kinematics(state), self.settings.tolerance * self.body.size
        if self._dynamics.prony and unrelaxed(state) > self.UNRELAXED * self.settings.tolerance:
            return False
        slow = self._calm * largest(now.velocity.ravel()) <= near
        return slow and self._calm**2 * largest(now.acceleration.ravel()) <= near

    def is_settled(self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> bool:
        """Return whether a state does not change at these commands: it is at rest, or every step fails."""
        failure = state.ledger.failure
        stuck = failure is not None and (failure.poses, failure.commands) == (targets, commands)
        return stuck or self.rests(state, targets, commands)

    def step(
        self,
        state: State,
        targets: Mapping[str, Pose],
        commands: Mapping[str, float],
        *,
        duration: float,
        deadline: Deadline | None = None,
        observer: Callable[[InternalStep], None] | None = None,
    ) -> PathResult:
        """Return the outcome of ``duration`` [s]; the commands change linearly from those of ``state`` to the new ones.

        ``state`` is not modified. A duration that is too short for a step is added to the next duration. A deadline
        ends the step between two internal steps: an internal step in progress is finished, because a partial solution
        has no velocity. An interruption discards the internal step in progress. The ``observer`` is called after each
        internal step.
        """
        owed, step = state.ledger.owed, self._dynamics.step
        due = owed + duration
        if due < self.SHORTEST * step:
            noted = state.with_(ledger=replace_fields(state.ledger, owed=due))
            return PathResult(state=noted, completed=True, simulated=duration, skipped={Skip.SOLVE.value: 1})
        began = self.start_motion(state, commands)
        if observer is not None and began is not state:
            observer(InternalStep(before=state, after=began, h=step))
        given = {"tolerance": self.settings.tolerance, "limit": self.settings.max_iterations, "deadline": deadline}
        goal = Increment(poses=targets, commands=commands, **given)
        count = max(1, math.ceil(due / step - NEGLIGIBLE))
        result = self._follow(TimePath.over(began, goal, count, duration=due), observer)
        # An earlier step has already reported the owed time.
        ledger = replace_fields(result.state.ledger, owed=max(0.0, owed - result.simulated))
        return replace_fields(
            result, state=result.state.with_(ledger=ledger), simulated=max(0.0, result.simulated - owed)
        )

    def _follow(self, path: TimePath, observer: Callable[[InternalStep], None] | None) -> PathResult:
        """Return the outcome of a path."""
        failure = path.state.ledger.failure if Skip.SOLVE in self.settings.skip else None
        if failure is not None and path.repeats(failure):
            return replace_fields(path, flaw=failure.reason).result({Skip.SOLVE.value: 1})
        deadline = path.goal.deadline
        while not path.completed:
            trial = self._try(path, self._dynamics)
            path, verdict = trial.path, trial.verdict
            if verdict is Verdict.WITHDRAW:
                return path.withdraw(trial.solution, self.equilibrium.count_skipped(), hurried=past(deadline))
            if verdict is Verdict.STOP:
                path = replace_fields(path, flaw=trial.solution.message)
                break
            if verdict is Verdict.HALVE:
                path = path.halve()
                continue
            if observer is not None:
                observer(trial.step)
            path = path.advance(trial.step.after)
            if not path.completed and past(deadline):
                path = replace_fields(path, flaw=path.flaw or deadline.reason)
                break
        return path.result(self.equilibrium.count_skipped())

    def _try(self, path: TimePath, dynamics: Dynamics) -> Trial:
        """Solve the next internal step; repeat it with the Euler scheme if it created energy."""
        deadline, h = path.goal.deadline, path.length
        interruption = deadline.interruption if deadline else None
        solution = self._solve(path, dynamics, interruption)
        path = path.record_attempt(solution)
        given = {"path": path, "solution": solution}
        if solution.cut and past(interruption):
            return Trial(**given, verdict=Verdict.STOP)
        if has_failed(solution) and path.can_halve and not past(deadline):
            return Trial(**given, verdict=Verdict.HALVE)
        if not (is_unfolded(solution) or path.endures(solution)):
            return Trial(**given, verdict=Verdict.WITHDRAW)
        before = path.state
        after, excess = self._accounts.book(before, self._accept(dynamics, before, solution, h), h)
        if excess and dynamics is self._dynamics:
            return self._try(path, self._euler)
        if excess and path.can_halve and not past(deadline):
            return Trial(**given, verdict=Verdict.HALVE)
        if excess:
            after = tell_excess(after, excess, h, self._dynamics.scheme)
        step = InternalStep(before=before, after=after, h=h, share=path.next, dynamics=dynamics)
        return Trial(**given, verdict=Verdict.ACCEPT, step=step)

    def _solve(self, path: TimePath, dynamics: Dynamics, interruption: Deadline | None) -> Solution:
        """Return the solution of the next internal step of ``path``."""
        state, h, (poses, commands) = path.state, path.length, path.next_place
        now = Kinematics.of(state.terms[inertia.NAME])
        bent, moved = h * h * largest(now.acceleration.ravel()), h * largest(now.velocity.ravel())
        size, tolerance = self.body.size, self.settings.tolerance
        problem = replace_fields(
            path.goal,
            poses=poses,
            commands=commands,
            tolerance=tolerance * reduction(self._coarser * max(bent, moved) if self._held else bent, size),
            deadline=interruption,
            keeping=tolerance,
            volumes=tolerance * reduction(bent, size) if self._fed else None,
        )
        return self.equilibrium_of(dynamics, h).solve(problem, state)

    def _accept(self, dynamics: Dynamics, state: State, solution: Solution, h: float) -> State:
        """Return the state after an internal step of length ``h`` [s] from ``state``, with the ledger of ``state``."""
        equilibrium = self.equilibrium_of(dynamics, h)
        now = equilibrium.accept(solution, state)
        balance = now.balance or equilibrium.actuation.balance(now.positions, now.commands)
        return self.strike(dynamics, state, now.with_(unfinished=None, balance=balance, sound=True), h)

    def strike(
        self, dynamics: Dynamics, before: State, now: State, h: float, free_mass: FreeMass | None = None
    ) -> State:
        """Return the state ``now`` after an internal step from ``before``, with the impulses of the contacts.

        ``free_mass`` replaces the body's own, in the derivatives by densities.
        """
        impulses = ContactImpulses(self.free_mass if free_mass is None else free_mass)
        return impulses.add(dynamics, before, now, h, self.equilibrium_of(dynamics, h).actuation.held)

    def place(self, state: State, positions: Array) -> State:
        """Return a state at ``positions`` (n, 3) [m] with the initial velocities; handles keep their poses."""
        found = place(self.body, self.equilibrium.handles, state, positions, afresh=self.at_rest())
        return found.with_(ledger=replace_fields(found.ledger, bound=None))

    def find_imbalance(self, state: State) -> float:
        """Return the energy [J] that is not accounted for: kinetic + elastic + potential + dissipated - work."""
        found = self.energies(state)
        return sum(found[name] for name in ("kinetic", "elastic", "potential", "dissipated")) - found["work"]

    def book_imbalance(self, state: State, unbalanced: float) -> State:
        """Return ``state`` with its potential, and with work chosen so that `find_imbalance` returns ``unbalanced``."""
        self.actuation.begin(state.commands, state.terms, state.positions, state.poses, state)
        found = state.with_(balance=self.actuation.balance(state.positions, state.commands))
        work = found.ledger.work + self.find_imbalance(found) - unbalanced
        return found.with_(ledger=replace_fields(found.ledger, work=work))

    def carry_energies(self, state: State, before: State) -> State:
        """Return ``state`` with the energy account of ``before``; the change of energy between the two is work."""
        ledger = replace_fields(state.ledger, lost=before.ledger.lost)
        return self.book_imbalance(state.with_(ledger=ledger), self.find_imbalance(before))

    def velocities(self, state: State) -> Array:
        """Return the velocity (n, 3) [m/s] of every vertex, a copy."""
        return self._accounts.kinematics(state).velocity.copy()

    def accelerations(self, state: State) -> Array:
        """Return the acceleration (n, 3) [m/s^2] of every vertex; with contact, its mean over the last step."""
        return self._accounts.kinematics(state).trend

    def largest_acceleration(self, state: State) -> float:
        """Return the largest acceleration [m/s^2] of any vertex by the forces at the end of the step."""
        return float(largest(self._accounts.kinematics(state).acceleration.ravel()))

    def energies(self, state: State) -> dict[str, float]:
        """Return a dict from name to energy [J]; work and dissipated energy are totals since the start."""
        return self._accounts.energies(state)

    def _began(self, state: State) -> bool:
        return bool(state.terms[inertia.NAME]["h"][0])

    def start_motion(self, state: State, commands: Mapping[str, float]) -> State:
        """Return the state at the start of a motion, with all loads acting and with the accelerations by all forces.

        A state in motion is returned unchanged.
        """
        if self._began(state):
            return state
        loads = {name: commands[name] for name in self.actuation.loaded}
        before, state = state.commands, state.with_(commands={**state.commands, **loads})
        velocity, h = self._accounts.velocity_at_start(state.positions), self._dynamics.step
        pull = -self.equilibrium.forces(state) - self._dynamics.damping.mass * (self.mass @ velocity)
        acceleration = self.free_mass.accelerate(pull)
        kinematics = Kinematics.start(state.positions, velocity, acceleration, h, first=True)
        terms = {**state.terms, inertia.NAME: kinematics.saved}
        balance = self.actuation.balance(state.positions, state.commands)
        ledger = replace_fields(state.ledger, work=state.ledger.work + self._find_load_potential(state, before))
        return state.with_(terms=terms, balance=balance, ledger=self._accounts.begin_motion(ledger, acceleration, h))

    def _find_load_potential(self, state: State, before: Mapping[str, float]) -> float:
        """Return the change [J] of the loads' potential when loads start to act on a body that is already displaced."""
        at = self.actuation.balance
        now, then = (
            at(state.positions, given).potential - at(self.body.rest, given).potential
            for given in (state.commands, before)
        )
        return now - then
