# SPDX-License-Identifier: Apache-2.0
"""Energy account of a moving body: energies, work and dissipation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial.transform import Rotation

from gdfe_ros.solver.account import Bound, Ledger
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.motion import inertia, viscosity
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.motion.inertia import kinematics_of
from gdfe_ros.solver.state import Array, State
from gdfe_ros.solver.value import changed


class Accounts:
    """Computes a body's energy account.

    Args:
        body: the discretised body.
        mass: (n, n) its mass matrix [kg].
        dynamics: initial velocities and damping.
    """

    def __init__(self, body: Body, mass: sparse.csr_matrix, dynamics: Dynamics) -> None:
        self._body, self._mass, self._dynamics = body, mass, dynamics

    def opened(self) -> Ledger:
        """Return the ledger of the undeformed body with the scene's initial velocities."""
        velocity = self.velocity_at_start(self._body.rest)
        kinetic = self._kinetic(velocity)
        return Ledger(work=0.0, lost=0.0, bound=Bound(start=kinetic, least=kinetic, most=kinetic))

    def begun(self, ledger: Ledger, acceleration: Array, h: float) -> Ledger:
        """Return the ledger of a body that starts with an acceleration (n, 3) [m/s^2] in steps of ``h`` [s]."""
        swing = self._dynamics.swing * h * h * float(np.vdot(acceleration, self._mass @ acceleration))
        return changed(ledger, bound=_raised(ledger.bound, swing))

    def velocity_at_start(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the initial velocity (n, 3) [m/s] of the scene at ``positions`` (n, 3) [m]; zero for handles."""
        own = slice(self._body.count)
        weights = np.asarray(self._mass.sum(axis=0)).ravel()[own]
        centre = weights @ positions[own] / weights.sum()
        velocity = np.array(self._dynamics.velocity) + np.cross(self._dynamics.spin, positions - centre)
        for handle in self._body.handles:
            velocity[handle.vertices] = 0.0
        return velocity

    def after(self, before: State, now: State, h: float) -> Ledger:
        """Return the ledger after an internal step of length ``h`` [s], with the work by the trapezoidal rule.

        The uncertainty of the work is added to the bound. For each handle and command, the uncertainty is the
        difference between this work and the work of the force at one end of the step. The work of growth is unknown: if
        growth changes, the bound restarts.
        """
        ledger, first, last = before.ledger, before.summary.reactions, now.summary.reactions
        # Most links of an arm touch nothing; without a force there is no work.
        acting = [name for name in now.poses if first[name].any() or last[name].any()]
        moves = [(first[name], last[name], _motion(before, now, name)) for name in acting]
        slopes = ([balance.slopes.get(name, 0.0) for name in now.commands] for balance in (before.balance, now.balance))
        commands = list(zip(*slopes, before.change_to(now.commands), strict=True))
        work = sum(_work(*move) for move in moves) + sum(_work(*command) for command in commands)
        doubt = sum(abs(_work(-begin, end, change)) for begin, end, change in (*moves, *commands))
        drag = 0.0
        if self._dynamics.mass_damping:
            mean = 0.5 * (self._velocity(before) + self._velocity(now))
            drag = self._dynamics.mass_damping * h * np.vdot(mean, self._mass @ mean)
        lost = ledger.lost + float(drag) + now.dissipated - before.dissipated
        bound = _raised(ledger.bound, doubt) if now.operators is before.operators else None
        return Ledger(work=ledger.work + work, lost=lost, bound=bound)

    def energies(self, state: State, velocity: NDArray[np.float64]) -> dict[str, float]:
        """Return a dict from name to energy [J] of a state with a velocity (n, 3) [m/s]."""
        stored = float(state.terms[viscosity.NAME]["stored"][0]) if self._dynamics.damps else 0.0
        return {
            "kinetic": self._kinetic(velocity),
            "elastic": state.summary.energy + stored,
            "potential": state.balance.potential if state.balance else 0.0,
            "work": state.ledger.work,
            "dissipated": state.ledger.lost,
        }

    def _kinetic(self, velocity: Array) -> float:
        return 0.5 * float(np.vdot(velocity, self._mass @ velocity))

    @staticmethod
    def _velocity(state: State) -> NDArray[np.float64]:
        return kinematics_of(state.terms[inertia.NAME]).velocity


def _raised(bound: Bound | None, energy: float) -> Bound | None:
    return bound and changed(bound, start=bound.start + energy, least=bound.least + energy)


def _work(first: Array | float, last: Array | float, change: Array | float) -> float:
    """Return the work in a step: the mean of the ``first`` and ``last`` force, times the displacement ``change``."""
    return float(np.dot(0.5 * (first + last), change))


def _motion(before: State, now: State, name: str) -> NDArray[np.float64]:
    """Return translation [m] and rotation vector [rad] (6,) of a handle's command in a step."""
    first, last = before.poses[name], now.poses[name]
    if first == last:
        return np.zeros(6)
    turn = Rotation.from_rotvec(last.rotation) * Rotation.from_rotvec(first.rotation).inv()
    return np.concatenate([np.subtract(last.translation, first.translation), turn.as_rotvec()])
