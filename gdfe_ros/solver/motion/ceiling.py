# SPDX-License-Identifier: Apache-2.0
"""Upper bound of a moving body's energy, which detects steps that create energy."""

from __future__ import annotations

from gdfe_ros.solver.account import Bound, Ledger
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.motion import inertia
from gdfe_ros.solver.motion.dynamics import Scheme
from gdfe_ros.solver.motion.inertia import kinematics_of
from gdfe_ros.solver.motion.ledger import Accounts
from gdfe_ros.solver.state import State
from gdfe_ros.solver.value import NEGLIGIBLE, changed

ABOVE_START = 0.01
"""Allowed excess over the initial energy, as fraction of the largest energy so far. The energy of a spinning body
oscillates by this fraction with sixty steps per turn.
"""
ABOVE_LEAST, ABOVE_LEAST_BDF2 = 0.03, 0.25
"""Allowed excess over the least energy so far, as fraction of the largest energy so far; the second for `bdf2`. In
resolved motions the energy oscillates by a hundredth, because hourglass stiffness depends on strains. With `bdf2` the
energy drops too far when the body is stopped, and rises again.
"""


class Ceiling:
    """Detects steps that create energy.

    The balance kinetic + elastic + potential energy - work is constant, or falls by the dissipated energy. It may
    exceed its initial and its least value by the sum of two energies. These are a fraction of the largest kinetic +
    elastic energy so far, and the energy of a strain as large as the tolerance.

    Args:
        body: the discretised body.
        scheme: time integration scheme.
        tolerance: tolerance of an equilibrium, divided by the body's size.
        accounts: the energy accounts of the body.
    """

    def __init__(self, body: Body, scheme: Scheme, tolerance: float, accounts: Accounts) -> None:
        self._noise = 0.5 * tolerance**2 * body.strain_energy_scale
        self._above_least, self._accounts = ABOVE_LEAST_BDF2 if scheme is Scheme.BDF2 else ABOVE_LEAST, accounts

    def checked(self, now: State) -> tuple[Ledger, float]:
        """Return the ledger of the state ``now`` after a step, and the energy [J] above the ceiling, at least 0."""
        velocity, bound = kinematics_of(now.terms[inertia.NAME]).velocity, now.ledger.bound
        energies = self._accounts.energies(now, velocity)
        stirred = energies["kinetic"] + energies["elastic"]
        balance = stirred + energies["potential"] - energies["work"]
        if bound is None:
            return changed(now.ledger, bound=Bound(start=balance, least=balance, most=stirred)), 0.0
        most = max(bound.most, stirred)
        ceiling = min(bound.start + ABOVE_START * most, bound.least + self._above_least * most)
        ceiling += self._noise + NEGLIGIBLE * sum(abs(energy) for energy in energies.values())
        after = changed(bound, least=min(bound.least, balance), most=most)
        return changed(now.ledger, bound=after), max(0.0, balance - ceiling)


def told(state: State, excess: float, h: float, scheme: Scheme) -> State:
    """Return a state with a message that its last step of length ``h`` [s] created the energy ``excess`` [J].

    The excess is added to the bound, so that the message appears only once.
    """
    bound, summary = state.ledger.bound, state.summary
    text = (
        f"an internal step of {h:.3g} s gained {excess:.3g} J of energy without a source; remedy: a smaller "
        "dynamics.step, a start outside of all obstacles"
    ) + ("" if scheme == Scheme.BDF2 else ", or dynamics.scheme: bdf2")
    message = "; ".join(part for part in (summary.message, text) if part)
    raised = changed(bound, start=bound.start + excess, least=bound.least + excess)
    return state.with_(
        summary=changed(summary, converged=False, message=message), ledger=changed(state.ledger, bound=raised)
    )
