# SPDX-License-Identifier: Apache-2.0
"""Internal steps of any length by one time integration scheme, with their pushes and impacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy import sparse

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import Deadline
from gdfe_ros.solver.distance import largest
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.motion import inertia
from gdfe_ros.solver.motion.dynamics import Dynamics, Scheme
from gdfe_ros.solver.motion.flight import Flight
from gdfe_ros.solver.motion.impact import Impacts
from gdfe_ros.solver.motion.inertia import Inertia, kinematics_of
from gdfe_ros.solver.motion.mass import FreeMass
from gdfe_ros.solver.motion.predictor import FlightPredictor
from gdfe_ros.solver.motion.push import Pushes
from gdfe_ros.solver.motion.viscosity import Viscosity
from gdfe_ros.solver.settings import SolverSettings
from gdfe_ros.solver.solution import Increment, Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.actuation import Actuation
from gdfe_ros.solver.terms.term import Term

ACCURACY = 3.0
"""Tolerance of an internal step, divided by the solver's tolerance and by the distance h^2 |a| of the fastest vertex.
The tolerance is at most the solver's tolerance.
"""
HELD = 3.0
"""A body that only handles hold has a tolerance larger by this factor, and the distance is at least h |v|. With free
bodies, only the accuracy of the solve conserves the momentum. Pressures always have the smaller tolerance: pressures
that lag behind the motion add energy. `newmark` has no dissipation, and never gets the factor.
"""
FINEST = 1e-4
"""Least tolerance of an internal step, divided by the solver's tolerance."""
KEPT = 4
"""Number of step lengths whose factors are kept."""


class Integrator:
    """Makes internal steps of a body, one at a time. It stores no state, only factors for the step lengths in use.

    Args:
        body: the discretised body.
        settings: settings of the solver.
        dynamics: scheme and damping.
        mass: (n, n) mass matrix [kg].
        free_mass: mass of the free vertices.
        acting: function that returns the actuation with given additional terms.
        euler: whether backward Euler, which needs only the last state, replaces the scheme.
    """

    def __init__(
        self,
        body: Body,
        settings: SolverSettings,
        dynamics: Dynamics,
        mass: sparse.csr_matrix,
        free_mass: FreeMass,
        acting: Callable[[Sequence[Term]], Actuation],
        *,
        euler: bool = False,
    ) -> None:
        self._body, self._settings, self._mass, self._acting, self._euler = body, settings, mass, acting, euler
        self._scheme = dynamics.scheme
        if euler:
            dynamics = replace(dynamics, scheme=Scheme.BDF2, rho_inf=Dynamics.rho_inf)
        self._dynamics = dynamics
        # Pressures that lag behind a motion add energy to it; without damping they must not lag.
        self._fed = self._scheme is not Scheme.BDF2 and not (dynamics.damps or dynamics.mass_damping)
        self._held = bool(body.handles) and not body.rigid_bodies
        self._coarser = 1.0 if self._scheme is Scheme.NEWMARK else HELD
        self._made: dict[float, EquilibriumSolver] = {}
        self._pushes, self._impacts = Pushes(free_mass, dynamics, self._scheme), Impacts(body, dynamics, self._scheme)

    def solve(self, flight: Flight, h: float, deadline: Deadline | None) -> Solution:
        """Return the solution of the next internal step of ``flight``, of length ``h`` [s]."""
        state, (poses, commands) = self.begun(flight.state), flight.aim
        now = kinematics_of(state.terms[inertia.NAME])
        bent, moved = h * h * largest(now.acceleration.ravel()), h * largest(now.velocity.ravel())
        size, tolerance = self._body.size, self._settings.tolerance
        problem = Increment(
            poses=poses,
            commands=commands,
            tolerance=tolerance * reduction(self._coarser * max(bent, moved) if self._held else bent, size),
            limit=self._settings.max_iterations,
            deadline=deadline,
            keeping=tolerance,
            volumes=tolerance * reduction(bent, size) if self._fed else None,
        )
        equilibrium = self.equilibrium(h)
        self._pushes.fit(state, h, equilibrium.actuation.contacts)
        return equilibrium.solve(problem, state)

    def accepted(self, state: State, solution: Solution, h: float) -> State:
        """Return the state after an internal step of length ``h`` [s] from ``state``, with the ledger of ``state``."""
        first, equilibrium = bool(state.terms[inertia.NAME]["first"][0]), self.equilibrium(h)
        state = self.begun(state)
        now = equilibrium.accept(solution, state)
        balance = now.balance or equilibrium.actuation.balance(now.positions, now.commands)
        now = now.with_(unfinished=None, balance=balance, sound=True)
        return self.followed(state, now, h, first=first)

    def followed(self, before: State, now: State, h: float, *, first: bool) -> State:
        """Return the state ``now`` after a step, without pushes and impacts in the forces that the next step uses."""
        contacts = self.equilibrium(h).actuation.contacts
        now = self._impacts.stopped(before, now, h, contacts, first=first)
        return self._pushes.forgotten(before, now, h, contacts)

    def fit(self, before: State, h: float) -> None:
        """Set the contacts' ratio of force to multiplier for a step of length ``h`` [s] from ``before``."""
        self._pushes.fit(before, h, self.equilibrium(h).actuation.contacts)

    @property
    def dynamics(self) -> Dynamics:
        """Scheme and damping in use."""
        return self._dynamics

    def equilibrium(self, h: float) -> EquilibriumSolver:
        """Return the equilibrium solver of internal steps of length ``h`` [s]."""
        if h in self._made:
            return self._made[h]
        own = [Inertia(self._body, self._mass, self._dynamics, h)]
        if self._dynamics.damps:
            own.append(Viscosity(self._body, self._dynamics, h))
        masses = np.asarray(self._mass.sum(axis=1)).ravel()
        while len(self._made) >= KEPT:
            del self._made[next(iter(self._made))]
        self._made[h] = EquilibriumSolver(
            self._body,
            self._acting(own),
            skip=self._settings.skip,
            threads=self._settings.threads,
            predictor=lambda *given: FlightPredictor(self._body, *given, h, masses),
            softening=self._scheme is not Scheme.NEWMARK,
        )
        return self._made[h]

    def begun(self, state: State) -> State:
        """Return ``state`` as the beginning of a step; backward Euler ignores the step before it."""
        if not self._euler:
            return state
        saved = {**state.terms[inertia.NAME], "first": np.ones(1)}
        return state.with_(terms={**state.terms, inertia.NAME: saved})


def reduction(moved: float, size: float) -> float:
    """Return the tolerance of an internal step in which a body moves by ``moved`` [m], divided by the solver's."""
    return min(1.0, max(FINEST, ACCURACY * moved / size))
