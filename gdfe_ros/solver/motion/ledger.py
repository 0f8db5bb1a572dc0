# SPDX-License-Identifier: Apache-2.0
"""Energy of a moving body: what it has, what was put in, what was lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial.transform import Rotation

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.motion import inertia, viscosity
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.motion.inertia import kinematics_of
from gdfe_ros.solver.state import Ledger, State


class Accounts:
    """Keeps a body's ledger.

    Args:
        body: the discretised body.
        mass: (n, n) its mass matrix [kg].
        dynamics: how it starts, and its damping.
    """

    def __init__(self, body: Body, mass: sparse.csr_matrix, dynamics: Dynamics) -> None:
        self._body, self._mass, self._dynamics = body, mass, dynamics

    def opened(self) -> Ledger:
        """Return the ledger of the start."""
        return Ledger(work=0.0, lost=0.0)

    def velocity_at_start(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the velocity (n, 3) [m/s] that a scene gives vertices at ``positions`` (n, 3) [m]; handles stand."""
        own = slice(self._body.count)
        weights = np.asarray(self._mass.sum(axis=0)).ravel()[own]
        centre = weights @ positions[own] / weights.sum()
        velocity = np.array(self._dynamics.velocity) + np.cross(self._dynamics.spin, positions - centre)
        for handle in self._body.handles:
            velocity[handle.vertices] = 0.0
        return velocity

    def after(self, before: State, now: State, h: float) -> Ledger:
        """Return the ledger after an internal step of length ``h`` [s]: work by the trapezoidal rule."""
        ledger, first = before.ledger, before.summary
        moved = sum(
            0.5 * (first.reactions[name] + now.summary.reactions[name]) @ _motion(before, now, name)
            for name in now.poses
        )
        changes = before.change_to(now.commands)
        slopes = (
            0.5 * (before.balance.slopes.get(name, 0.0) + now.balance.slopes.get(name, 0.0)) for name in now.commands
        )
        commanded = sum(slope * change for slope, change in zip(slopes, changes, strict=True))
        drag = 0.0
        if self._dynamics.mass_damping:
            mean = 0.5 * (self._velocity(before) + self._velocity(now))
            drag = self._dynamics.mass_damping * h * np.vdot(mean, self._mass @ mean)
        lost = ledger.lost + float(drag) + now.dissipated - before.dissipated
        return Ledger(work=ledger.work + float(moved + commanded), lost=lost)

    def energies(self, state: State, velocity: NDArray[np.float64]) -> dict[str, float]:
        """Return the energies [J] at a state with a velocity (n, 3) [m/s], by name."""
        stored = float(state.terms[viscosity.NAME]["stored"][0]) if self._dynamics.damps else 0.0
        return {
            "kinetic": 0.5 * float(np.vdot(velocity, self._mass @ velocity)),
            "elastic": state.summary.energy + stored,
            "potential": state.balance.potential if state.balance else 0.0,
            "work": state.ledger.work,
            "dissipated": state.ledger.lost,
        }

    @staticmethod
    def _velocity(state: State) -> NDArray[np.float64]:
        return kinematics_of(state.terms[inertia.NAME]).velocity


def _motion(before: State, now: State, name: str) -> NDArray[np.float64]:
    """Return translation [m] and rotation vector [rad] (6,) of a handle's command in a step."""
    first, last = before.poses[name], now.poses[name]
    if first == last:
        return np.zeros(6)
    turn = Rotation.from_rotvec(last.rotation) * Rotation.from_rotvec(first.rotation).inv()
    return np.concatenate([np.subtract(last.translation, first.translation), turn.as_rotvec()])
