# SPDX-License-Identifier: Apache-2.0
"""Pushes of contacts: forces that are constant over a step, and forgotten after it.

A scheme of second order counts on the forces of a step for the next one, in which the body may have left what pushed
it, and makes energy of that. So a contact pushes with one force F all through the step. A solve finds the multiplier,
the force at the step's end that moves the body as far as F does in all of it; the rule's `share` is their ratio.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gdfe_ros.solver.contact.contact_term import ContactTerm
from gdfe_ros.solver.contact.rigid_contact import RigidContact
from gdfe_ros.solver.motion.dynamics import Dynamics, Scheme
from gdfe_ros.solver.motion.inertia import NAME, rule_of
from gdfe_ros.solver.motion.mass import FreeMass
from gdfe_ros.solver.state import State


class Pushes:
    """Keeps the pushes of a body's contacts out of what its next step counts on.

    Args:
        mass: of what is free to move.
        dynamics: of the steps.
        scheme: whose next step counts on what is left. ``bdf2`` has no pushes: it damps what contacts excite. But for
            ``newmark`` what is hard on both sides has `Impacts` instead: it does not bounce.
    """

    def __init__(self, mass: FreeMass, dynamics: Dynamics, scheme: Scheme) -> None:
        self._mass, self._dynamics, self._scheme = mass, dynamics, scheme

    def fit(self, before: State, h: float, contacts: Sequence[ContactTerm]) -> None:
        """Tell contacts, for a step of length ``h`` [s] from ``before``, what of their multipliers is force."""
        for contact in contacts:
            pushes = self._are_of(contact)
            contact.share = rule_of(self._dynamics, h, before.terms[NAME]).share if pushes else 1.0

    def forgotten(self, before: State, now: State, h: float, contacts: Sequence[ContactTerm]) -> State:
        """Return the state after a step of length ``h`` [s] from ``before`` that tells pushes from other forces."""
        pushing = [contact for contact in contacts if self._are_of(contact)]
        if not pushing:
            return now
        rule, saved, forces = rule_of(self._dynamics, h, before.terms[NAME]), now.terms[NAME], np.zeros_like(now.base)
        for contact in pushing:
            contact.add_forces(now.positions, forces)
        multiplied = self._mass.accelerated(forces)
        pushed = rule.share * multiplied
        kept = {
            **saved,
            "acceleration": saved["acceleration"] - rule.kappa_a / rule.kappa * multiplied + pushed,
            "balanced": saved["balanced"] - multiplied,
            "pushed": pushed,
            "shadow": rule.shadow(pushed),
        }
        return now.with_(terms={**now.terms, NAME: kept})

    def _are_of(self, contact: ContactTerm) -> bool:
        scheme = self._scheme
        return scheme is Scheme.NEWMARK or (scheme is not Scheme.BDF2 and not isinstance(contact, RigidContact))
