# SPDX-License-Identifier: Apache-2.0
"""Internal steps of any length by one time integration scheme: prediction, solve, and impulses of contacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import Deadline
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.equilibrium.predictor import Prediction, Predictor
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.motion import inertia
from gdfe_ros.solver.motion.dynamics import Dynamics, Scheme
from gdfe_ros.solver.motion.flight import Flight
from gdfe_ros.solver.motion.impulse import ContactImpulses
from gdfe_ros.solver.motion.inertia import NAME, FreeMass, Inertia, kinematics_of
from gdfe_ros.solver.motion.viscosity import Viscosity
from gdfe_ros.solver.settings import SolverSettings
from gdfe_ros.solver.solution import Increment, Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import Term
from gdfe_ros.solver.vectors import largest


class FlightPredictor(Predictor):
    """Predicts the end of a step of one length from a state and its velocities.

    Args:
        body: the discretised body.
        handles: the kinematics of its handles.
        matrix: the constant matrix.
        h: length of the step [s].
        masses: (n,) masses of the vertices [kg].
    """

    SHARES = (1.0, 0.5, 0.25, 0.125, 0.0)
    """Fractions of the free flight that are tried in turn until no element is folded. A force on one light vertex may
    move it across many cells in a step, and a start with folds ends in another equilibrium. Without handles, the centre
    of mass always moves by the whole free flight: the minimisation corrects it only to within the tolerance, and
    momentum would change.
    """

    def __init__(
        self, body: Body, handles: HandleMotions, matrix: ConstantMatrix, h: float, masses: NDArray[np.float64]
    ) -> None:
        super().__init__(body, handles, matrix)
        self._h = h
        self._shares = np.zeros_like(masses) if body.handles else masses / masses.sum()

    def predict(self, state: State, base: NDArray[np.float64], change: NDArray[np.float64]) -> Prediction:
        """Return the start of a solve that moves the handles from ``state`` to ``base`` (n, 3) [m]."""
        now, h, last, held = kinematics_of(state.terms[NAME]), self._h, state.motion, self._held
        slides, turns = state.slides, state.turns
        if last is not None:
            slides, turns = slides + last.slides, turns + last.turns
        flight = h * now.velocity + 0.5 * h * h * now.trend(h)
        drift, flight = self._shares @ flight, flight[self._free]
        led = state.positions.copy()
        led[held] += base[held] - state.base[held]
        for share in (*self.SHARES, 1.0):  # handles may fold elements whatever the other vertices do
            start = led.copy()
            start[self._free] += share * flight + (1.0 - share) * drift
            if least_volume_ratio(start, self._shape) > 0.0:
                break
        return Prediction(start, slides, turns, 1.0)


ACCURACY = 3.0
"""Tolerance of an internal step, divided by the solver's tolerance and by the distance h^2 |a| of the fastest vertex.
The tolerance is at most the solver's tolerance.
"""
FINEST = 1e-4
"""Least tolerance of an internal step, divided by the solver's tolerance."""


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

    Attributes:
        dynamics: scheme and damping in use.
    """

    HELD = 3.0
    """A body that only handles hold has a tolerance larger by this factor, and the distance is at least h |v|. With
    free bodies, only the accuracy of the solve conserves the momentum. Pressures always have the smaller tolerance:
    pressures that lag behind the motion add energy. `newmark` has no dissipation, and never gets the factor.
    """
    KEPT = 4
    """Number of step lengths whose factors are kept."""

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
        self._undamped = dynamics.undamped
        # Pressures that lag behind a motion add energy to it; without damping they must not lag.
        self._fed = dynamics.scheme is not Scheme.BDF2 and not (dynamics.damps or dynamics.damping.mass)
        self._coarser = 1.0 if dynamics.undamped else self.HELD
        if euler:
            dynamics = replace(dynamics, scheme=Scheme.BDF2, rho_inf=Dynamics.rho_inf)
        self.dynamics = dynamics
        self._held = bool(body.handles) and not body.rigid_bodies
        self._made: dict[float, EquilibriumSolver] = {}
        self._impulses = ContactImpulses(free_mass, dynamics)

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
        return self.equilibrium(h).solve(problem, state)

    def accepted(self, state: State, solution: Solution, h: float) -> State:
        """Return the state after an internal step of length ``h`` [s] from ``state``, with the ledger of ``state``."""
        equilibrium = self.equilibrium(h)
        state = self.begun(state)
        now = equilibrium.accept(solution, state)
        balance = now.balance or equilibrium.actuation.balance(now.positions, now.commands)
        now = now.with_(unfinished=None, balance=balance, sound=True)
        return self.followed(state, now, h)

    def followed(self, before: State, now: State, h: float) -> State:
        """Return the state ``now`` after a step from ``before``, with the impulse of the contacts."""
        return self._impulses.add(before, now, h, self.equilibrium(h).actuation.contacts)

    def equilibrium(self, h: float) -> EquilibriumSolver:
        """Return the equilibrium solver of internal steps of length ``h`` [s]."""
        if h in self._made:
            return self._made[h]
        own = [Inertia(self._body, self._mass, self.dynamics, h)]
        if self.dynamics.damps:
            own.append(Viscosity(self._body, self.dynamics, h))
        masses = np.asarray(self._mass.sum(axis=1)).ravel()
        while len(self._made) >= self.KEPT:
            del self._made[next(iter(self._made))]
        self._made[h] = EquilibriumSolver(
            self._body,
            self._acting(own),
            skip=self._settings.skip,
            threads=self._settings.threads,
            predictor=lambda *given: FlightPredictor(self._body, *given, h, masses),
            softening=not self._undamped,
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


@dataclass(frozen=True, eq=False, kw_only=True)
class InternalStep:
    """An accepted internal step, for observers of a motion.

    Attributes:
        before, after: states before and after the internal step.
        h: its length [s].
        share: fraction of the whole step's change of commands that is completed after the internal step.
        integrator: the integrator that made it; None for the start of a motion, which only computes the accelerations
            of ``after``.
    """

    before: State
    after: State
    h: float
    share: float = 0.0
    integrator: Integrator | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """A solved internal step, and what follows from it.

    Attributes:
        flight: the flight, with the iterations of the trial.
        solution: the last solution.
        h: length of the internal step [s].
        integrator: the integrator of the last solution.
        interrupted: whether an interruption ended the solve.
        halves: whether a shorter internal step has to be tried.
        accepted: the state after the internal step; None if it is not accepted.
    """

    flight: Flight
    solution: Solution
    h: float
    integrator: Integrator
    interrupted: bool = False
    halves: bool = False
    accepted: State | None = None

    def observed(self, before: State, after: State, share: float) -> InternalStep:
        """Return this internal step, from ``before`` to ``after``, for observers; ``share`` as in `InternalStep`."""
        began, given = self.integrator.begun(before), {"h": self.h, "share": share, "integrator": self.integrator}
        return InternalStep(before=began, after=after, **given)


def unfolded(solution: Solution) -> bool:
    """Return whether no element is folded or inverted."""
    return not solution.diverged and solution.min_det > 0.0


def failed(solution: Solution) -> bool:
    """Return whether a solution failed and a shorter step may succeed."""
    stuck = not (solution.converged or solution.exhausted)
    return stuck or not unfolded(solution)
