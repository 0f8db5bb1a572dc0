# SPDX-License-Identifier: Apache-2.0
"""Time steps of a body with mass; each consists of internal steps, the minima of a potential."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.constraints import Pose
from gdfe_ros.materials.table import SHEAR
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import Deadline, past
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.motion import inertia
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.motion.flight import Flight
from gdfe_ros.solver.motion.inertia import FreeMass, kinematics_of, saved_of
from gdfe_ros.solver.motion.integrator import Integrator, InternalStep, Trial, failed, unfolded
from gdfe_ros.solver.motion.ledger import Accounts, Ceiling, told
from gdfe_ros.solver.motion.putting import pulled, put_elsewhere, require_free, stopped_at, vertices_of
from gdfe_ros.solver.motion.scheme import Kinematics
from gdfe_ros.solver.settings import Skip, SolverSettings
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.march import March
from gdfe_ros.solver.stepping.placing import placed, require_own
from gdfe_ros.solver.terms.term import Term
from gdfe_ros.solver.value import changed
from gdfe_ros.solver.vectors import largest


class MotionStepper:
    """Steps a body with mass in time. It stores no state, only factors for the step lengths in use.

    Args:
        body: the discretised body.
        settings: settings of the solver.
        dynamics: scheme and damping.
        mass: (n, n) its mass matrix [kg].
        acting: function that returns the actuation with given additional terms.

    Attributes:
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
    """Lower bound of the time of `CALM`, divided by the longest relaxation time of the body."""
    SHORTEST = 1e-2
    """Durations below this fraction of the longest internal step are only added up: differences over so short a time
    give only noise as acceleration.
    """

    def __init__(
        self,
        body: Body,
        settings: SolverSettings,
        dynamics: Dynamics,
        mass: sparse.csr_matrix,
        acting: Callable[[Sequence[Term]], Actuation],
    ) -> None:
        self.body, self._settings, self._dynamics, self.mass = body, settings, dynamics, mass
        self.free_mass = FreeMass(body, mass)
        made = body, settings, dynamics, mass, self.free_mass, acting
        self._integrator, self._euler = Integrator(*made), Integrator(*made, euler=True)
        self.equilibrium = self._integrator.equilibrium(dynamics.step)
        self.actuation = self.equilibrium.actuation
        self._accounts = Accounts(body, mass, dynamics, self.equilibrium.handles)
        self._ceiling = Ceiling(body, dynamics.scheme, settings.tolerance, self._accounts)
        self._calm = max(
            self.CALM, self.RELAXED * dynamics.relaxation(body.table.parameters[body.material][:, SHEAR].min())
        )

    def at_rest(self) -> State:
        """Return the initial state: the rest shape with the initial velocities of the scene."""
        return self.equilibrium.at_rest().with_(ledger=self._accounts.opened())

    def rests(self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> bool:
        """Return whether a body with handles is at rest and would stay at rest at these commands."""
        same = state.poses == targets and state.commands == commands and state.summary.converged
        if not (same and Skip.SOLVE in self._settings.skip and self.body.handles and self._began(state)):
            return False
        now, near = self._kinematics(state), self._settings.tolerance * self.body.size
        slow = self._calm * largest(now.velocity.ravel()) <= near
        return slow and self._calm**2 * largest(now.acceleration.ravel()) <= near

    def settled(self, state: State, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> bool:
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
    ) -> March:
        """Return the outcome of ``duration`` [s] in which the commands change linearly from those of ``state``.

        ``state`` is not modified. A duration that is too short for a step is added to the next duration. A deadline
        ends the step between two internal steps: an internal step in progress is finished, because a partial solution
        has no velocity. An interruption discards the internal step in progress. The ``observer`` is called after each
        internal step.
        """
        due = state.ledger.owed + duration
        if due < self.SHORTEST * self._dynamics.step:
            return _noted(state.with_(ledger=changed(state.ledger, owed=due)), duration)
        began = self.started(state, commands)
        if observer is not None and began is not state:
            observer(InternalStep(before=state, after=began, h=self._dynamics.step))
        flight = Flight.over(due, self._dynamics.step, began, targets, commands)
        failure = state.ledger.failure if Skip.SOLVE in self._settings.skip else None
        if failure is not None and flight.repeats(failure):
            march = changed(flight, flaw=failure.reason).march({Skip.SOLVE.value: 1})
            return _told(march, state.ledger.owed)
        while not flight.arrived:
            tried = self._tried(flight, self._integrator, deadline)
            flight, solution = tried.flight, tried.solution
            if tried.interrupted:
                flight = changed(flight, flaw=solution.message)
                break
            if tried.halves:
                flight = flight.halved()
                continue
            if tried.accepted is None:
                skipped = self.equilibrium.skipped()
                return _told(flight.withdrawn(solution, skipped, hurried=past(deadline)), state.ledger.owed)
            before, flight = flight.state, flight.went(tried.accepted)
            if observer is not None:
                observer(tried.observed(before, flight.state, flight.done / flight.total))
            if not flight.arrived and past(deadline):
                flight = changed(flight, flaw=flight.flaw or deadline.reason)
                break
        return _told(flight.march(self.equilibrium.skipped()), state.ledger.owed)

    def _tried(self, flight: Flight, integrator: Integrator, deadline: Deadline | None) -> Trial:
        """Solve the next internal step; repeat it with the Euler scheme if it created energy."""
        interruption, h = deadline.interruption if deadline else None, flight.length
        solution = integrator.solve(flight, h, interruption)
        flight = flight.tried(solution)
        given = {"flight": flight, "solution": solution, "h": h, "integrator": integrator}
        if solution.cut and past(interruption):
            return Trial(**given, interrupted=True)
        halves = failed(solution) and flight.can_halve and not past(deadline)
        if halves or not (unfolded(solution) or flight.endures(solution)):
            return Trial(**given, halves=halves)
        accepted, excess = self._accepted(integrator, flight.state, solution, h)
        if not excess:
            return Trial(**given, accepted=accepted)
        if integrator is self._integrator:
            return self._tried(flight, self._euler, deadline)
        if flight.can_halve and not past(deadline):
            return Trial(**given, halves=True)
        return Trial(**given, accepted=told(accepted, excess, h, self._dynamics.scheme))

    def place(self, state: State, positions: NDArray[np.float64]) -> State:
        """Return a state at ``positions`` (n, 3) [m] with the initial velocities; handles keep their poses."""
        found = placed(self.body, self.equilibrium.handles, state, positions, afresh=self.at_rest())
        return found.with_(ledger=changed(found.ledger, bound=None))

    def put(self, state: State, places: Mapping[str, Pose]) -> State:
        """Return a state with rigid bodies, by name, at poses relative to their rest poses and without velocity.

        The change of energy counts as work done on them.

        Raises:
            OverlapError: a rigid body is inside of an obstacle, another rigid body, or the soft body there.
        """
        found = put_elsewhere(self.body, self.equilibrium.handles, self.actuation, state, places)
        require_free(self.body, found, places)
        return self._let_go(found, vertices_of(self.body, places), before=state)

    def carry(self, state: State, vertices: NDArray[np.int32], positions: NDArray[np.float64]) -> State:
        """Return a state with the vertices of soft bodies at their rows of ``positions`` (n, 3) [m], without velocity.

        The bodies have moved rigidly. The change of energy counts as work done on them.
        """
        return self._let_go(stopped_at(self.body, self.actuation, state, vertices, positions), vertices, before=state)

    def _let_go(self, found: State, vertices: NDArray[np.int32], *, before: State) -> State:
        """Return ``found``, in which ``vertices`` are at other places than ``before``, with accelerations and work."""
        found = self.released(found, vertices)
        first, last = (self.actuation.balance(each.positions, before.commands) for each in (before, found))
        kinetic = [self._accounts.energies(each, self.velocities(each))["kinetic"] for each in (before, found)]
        work = before.ledger.work + last.potential - first.potential + kinetic[1] - kinetic[0]
        return found.with_(balance=last, ledger=changed(found.ledger, work=work))

    def released(self, state: State, vertices: NDArray[np.int32]) -> State:
        """Return ``state`` in which ``vertices``, which do not move, have the accelerations by their forces."""
        if not self._began(state):
            return state
        still = state.with_(terms={**state.terms, inertia.NAME: self.at_rest().terms[inertia.NAME]})
        return pulled(state, vertices, self.free_mass.accelerated(-self.equilibrium.forces(still)))

    def unbalanced(self, state: State) -> float:
        """Return the energy [J] that is not accounted for: kinetic + elastic + potential + dissipated - work."""
        found = self.energies(state)
        return sum(found[name] for name in ("kinetic", "elastic", "potential", "dissipated")) - found["work"]

    def continued(self, state: State, unbalanced: float) -> State:
        """Return ``state`` with its potential, and with work so that the energy not accounted for is ``unbalanced``."""
        self.actuation.begin(state.commands, state.terms, state.positions, state.poses, state)
        found = state.with_(balance=self.actuation.balance(state.positions, state.commands))
        work = found.ledger.work + self.unbalanced(found) - unbalanced
        return found.with_(ledger=changed(found.ledger, work=work))

    def carried(self, state: State, before: State) -> State:
        """Return ``state`` with the account of energies of ``before``: the body was carried here without work."""
        ledger = changed(state.ledger, work=before.ledger.work, lost=before.ledger.lost)
        return self.continued(state.with_(ledger=ledger), self.unbalanced(before))

    def completed(self, state: State) -> State:
        """Return a state that was read from an archive, with the operators that follow from its commands."""
        require_own(state, self.at_rest())
        growths = self.actuation.growths
        return state.with_(operators=growths.at(state.commands, growths.ungrown))

    def velocities(self, state: State) -> NDArray[np.float64]:
        """Return the velocity (n, 3) [m/s] of every vertex, a copy."""
        return self._kinematics(state).velocity.copy()

    def accelerations(self, state: State) -> NDArray[np.float64]:
        """Return the acceleration (n, 3) [m/s^2] of every vertex; with contact, the mean one of the last step."""
        return self._kinematics(state).trend(float(state.terms[inertia.NAME]["h"][0]) or self._dynamics.step)

    def largest_acceleration(self, state: State) -> float:
        """Return the largest acceleration [m/s^2] of any vertex by the forces at the end of the step."""
        return float(largest(self._kinematics(state).acceleration.ravel()))

    def energies(self, state: State) -> dict[str, float]:
        """Return a dict from name to energy [J]; work and dissipated energy are totals since the start."""
        return self._accounts.energies(state, self._kinematics(state).velocity)

    def _accepted(self, integrator: Integrator, state: State, solution: Solution, h: float) -> tuple[State, float]:
        """Return the state after an internal step of length ``h`` [s], and the energy [J] that the step created."""
        now = integrator.accepted(state, solution, h)
        now = now.with_(ledger=self._accounts.after(state, now, h))
        ledger, excess = self._ceiling.checked(now)
        return now.with_(ledger=ledger), excess

    def _kinematics(self, state: State) -> Kinematics:
        if self._began(state):
            return kinematics_of(state.terms[inertia.NAME])
        velocity = self._accounts.velocity_at_start(state.positions)
        return Kinematics.started(state.positions, velocity, np.zeros_like(velocity), 0.0)

    def _began(self, state: State) -> bool:
        return bool(state.terms[inertia.NAME]["h"][0])

    def started(self, state: State, commands: Mapping[str, float]) -> State:
        """Return the state at the start of a motion: with the accelerations by its forces, and all loads acting.

        A state in motion is returned unchanged.
        """
        if self._began(state):
            return state
        loads = {name: commands[name] for name in self.actuation.loaded}
        before, state = state.commands, state.with_(commands={**state.commands, **loads})
        velocity, h = self._accounts.velocity_at_start(state.positions), self._dynamics.step
        pull = -self.equilibrium.forces(state) - self._dynamics.damping.mass * (self.mass @ velocity)
        acceleration = self.free_mass.accelerated(pull)
        kinematics = Kinematics.started(state.positions, velocity, acceleration, h, first=True)
        terms = {**state.terms, inertia.NAME: saved_of(kinematics, h=h, positions=state.positions)}
        balance = self.actuation.balance(state.positions, state.commands)
        ledger = changed(state.ledger, work=state.ledger.work + self._raised(state, before))
        return state.with_(terms=terms, balance=balance, ledger=self._accounts.begun(ledger, acceleration, h))

    def _raised(self, state: State, before: Mapping[str, float]) -> float:
        """Return the change [J] of the loads' potential if loads start to act on a body that is already displaced."""
        rest = self.at_rest().positions
        if np.array_equal(rest, state.positions):
            return 0.0
        now, then = (
            self.actuation.balance(state.positions, given).potential - self.actuation.balance(rest, given).potential
            for given in (state.commands, before)
        )
        return now - then


def _noted(state: State, duration: float) -> March:
    """Return the outcome of a step in which only time passed."""
    summary, counts = state.summary, {"iterations": 0, "increments": 0, "skipped": {Skip.SOLVE.value: 1}}
    said = {"converged": summary.converged, "message": summary.message}
    return March(state=state, reached=True, simulated=duration, **said, **counts)


def _told(march: March, owed: float) -> March:
    """Return an outcome whose simulated time excludes ``owed`` [s], which an earlier step has reported."""
    ledger = changed(march.state.ledger, owed=max(0.0, owed - march.simulated))
    return changed(march, state=march.state.with_(ledger=ledger), simulated=max(0.0, march.simulated - owed))
