# SPDX-License-Identifier: Apache-2.0
"""Energy account of a moving body: energies, work and dissipation, and the bound that detects created energy."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.motion import inertia, viscosity
from gdfe_ros.solver.motion.scheme import Kinematics
from gdfe_ros.solver.outcome import join
from gdfe_ros.solver.settings import Dynamics, Scheme
from gdfe_ros.solver.state import Array, Bound, Ledger, State, replace_fields
from gdfe_ros.solver.stepping.path import work_between
from gdfe_ros.solver.vectors import NEGLIGIBLE


class Accounts:
    """Computes a body's energy account, and detects steps that create energy.

    The balance, kinetic + elastic + potential energy - work, is constant, or falls by the dissipated energy. A step has
    created energy if the balance exceeds its initial or its least value by more than a margin. The margin has two
    parts: a fraction of the largest kinetic + elastic energy so far, and the energy of a strain as large as the
    tolerance.

    Args:
        body: the discretised body.
        mass: (n, n) its mass matrix [kg].
        dynamics: scheme, initial velocities and damping.
        handles: the kinematics of its handles.
        tolerance: tolerance of an equilibrium, divided by the body's size.
    """

    ABOVE_START = 0.01
    """Allowed excess of the balance over its initial value, divided by the largest kinetic + elastic energy so far.
    With sixty steps per turn, the energy of a spinning body oscillates by this fraction.
    """
    ABOVE_LEAST, ABOVE_LEAST_BDF2 = 0.03, 0.25
    """Allowed excess of the balance over its least value so far, divided by the largest kinetic + elastic energy so
    far; the second number is for `bdf2`. In resolved motions the energy oscillates by a hundredth, because hourglass
    stiffness depends on strains. With `bdf2` the energy drops too far when the body is stopped, and rises again.
    """

    def __init__(
        self, body: Body, mass: sparse.csr_matrix, dynamics: Dynamics, handles: HandleMotions, tolerance: float
    ) -> None:
        self._body, self._mass, self._dynamics, self._handles = body, mass, dynamics, handles
        self._noise = 0.5 * tolerance**2 * body.strain_energy_scale
        self._known: tuple[Array | None, float] = None, 0.0
        self._above_least = self.ABOVE_LEAST_BDF2 if dynamics.scheme is Scheme.BDF2 else self.ABOVE_LEAST

    def open_ledger(self) -> Ledger:
        """Return the ledger of the undeformed body with the scene's initial velocities."""
        kinetic = self._kinetic(self.velocity_at_start(self._body.rest))
        return Ledger(work=0.0, lost=0.0, bound=Bound(start=kinetic, least=kinetic, most=kinetic))

    def begin_motion(self, ledger: Ledger, acceleration: Array, h: float) -> Ledger:
        """Return the ledger of a body that starts with an acceleration (n, 3) [m/s^2] in steps of ``h`` [s]."""
        swing = self._dynamics.swing * h * h * float(np.vdot(acceleration, self._mass @ acceleration))
        return replace_fields(ledger, bound=ledger.bound and ledger.bound.allow(swing))

    def velocity_at_start(self, positions: Array) -> Array:
        """Return the initial velocity (n, 3) [m/s] at ``positions`` (n, 3) [m]; held axes of handles are at rest."""
        own = slice(self._body.count)
        weights = np.asarray(self._mass.sum(axis=0)).ravel()[own]
        centre = weights @ positions[own] / weights.sum()
        linear, spin = np.array(self._dynamics.velocity), np.array(self._dynamics.spin)
        velocity = linear + np.cross(spin, positions - centre)
        for handle in self._body.handles:
            if handle.slide is not None:
                velocity[handle.vertices] *= handle.slide
            elif len(handle.vertices):
                arms = positions[handle.vertices] - (middle := handle.centre(positions))
                slides, turns = (np.isin(range(3), axes) for axes in (handle.free, handle.turning))
                middle_velocity = slides * (linear + np.cross(spin, middle - centre))
                velocity[handle.vertices] = middle_velocity + np.cross(turns * spin, arms)
        velocity[self._body.count :] = 0.0  # rigid bodies
        return velocity

    def kinematics(self, state: State) -> Kinematics:
        """Return the kinematics of a state; before the start of its motion, they have the initial velocity."""
        now = Kinematics.of(state.terms[inertia.NAME])
        if now.h:
            return now
        return Kinematics.start(
            state.positions, self.velocity_at_start(state.positions), np.zeros_like(now.velocity), 0.0
        )

    def book(self, before: State, now: State, h: float) -> tuple[State, float]:
        """Return ``now`` with the ledger after an internal step of length ``h`` [s], and the energy [J] it created.

        On entry, ``now`` has the ledger of ``before``, plus the work of obstacles on rigid bodies. The other work is
        computed by the trapezoidal rule, and its uncertainty (see `work_between`) is added to the bound. The work of
        growth is unknown: if growth changes, the bound restarts.
        """
        ledger, (work, doubt) = now.ledger, work_between(before, now, self._handles)
        drag = 0.0
        if self._dynamics.damping.mass:
            mean = 0.5 * (self.kinematics(before).velocity + self.kinematics(now).velocity)
            drag = self._dynamics.damping.mass * h * np.vdot(mean, self._mass @ mean)
        lost = ledger.lost + float(drag) + now.dissipated - before.dissipated
        bound = ledger.bound.allow(doubt) if ledger.bound and now.operators is before.operators else None
        ledger = Ledger(work=ledger.work + work, lost=lost)
        energies = self.energies(now.with_(ledger=ledger))
        stirred = energies["kinetic"] + energies["elastic"]
        balance = stirred + energies["potential"] - energies["work"]
        bound = bound or Bound(start=balance, least=balance, most=stirred)
        most = max(bound.most, stirred)
        ceiling = min(bound.start + self.ABOVE_START * most, bound.least + self._above_least * most)
        ceiling += self._noise + NEGLIGIBLE * sum(abs(energy) for energy in energies.values())
        bound = replace_fields(bound, least=min(bound.least, balance), most=most)
        return now.with_(ledger=replace_fields(ledger, bound=bound)), max(0.0, balance - ceiling)

    def energies(self, state: State) -> dict[str, float]:
        """Return a dict from name to energy [J]; work and dissipated energy are totals since the start."""
        stored = float(state.terms[viscosity.NAME]["stored"][0]) if self._dynamics.damps else 0.0
        return {
            "kinetic": self._kinetic(self.kinematics(state).velocity),
            "elastic": state.summary.energy + stored,
            "potential": state.balance.potential if state.balance else 0.0,
            "work": state.ledger.work,
            "dissipated": state.ledger.lost,
        }

    def _kinetic(self, velocity: Array) -> float:
        """Return the kinetic energy [J]; the last result is cached, because the arrays of states are never modified."""
        if velocity is not self._known[0]:
            self._known = velocity, 0.5 * square(velocity, self._mass.indptr, self._mass.indices, self._mass.data)
        return self._known[1]


@kernel
def square(v, starts, columns, entries):
    """Return v . M v for ``v`` (n, 3) and a sparse matrix M (n, n): row starts, columns and entries."""
    total = 0.0
    for i in range(len(v)):
        for j in range(starts[i], starts[i + 1]):
            w = columns[j]
            total += entries[j] * (v[i, 0] * v[w, 0] + v[i, 1] * v[w, 1] + v[i, 2] * v[w, 2])
    return total


def tell_excess(state: State, excess: float, h: float, scheme: Scheme) -> State:
    """Return a state with a message that its last step of length ``h`` [s] created the energy ``excess`` [J].

    The bound starts anew, so that the message appears only once.
    """
    text = (
        f"an internal step of {h:.3g} s gained {excess:.3g} J of energy without a source; remedy: a smaller "
        "dynamics.step, a start outside of all obstacles"
    ) + ("" if scheme == Scheme.BDF2 else ", or dynamics.scheme: bdf2")
    flawed = state.with_flaw(join(state.summary.message, text))
    return flawed.with_(ledger=replace_fields(state.ledger, bound=None))
