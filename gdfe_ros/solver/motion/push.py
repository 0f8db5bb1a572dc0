# SPDX-License-Identifier: Apache-2.0
"""Pushes of contacts: contact forces that are constant over a step and do not enter the next step.

A scheme of second order uses the forces of one step in the next step. If the body has left the contact by then, this
creates energy. A contact therefore pushes with one force F throughout the step. A solve finds the multiplier: the force
at the end of the step that causes the same displacement as F. The ratio of F to the multiplier is the rule's `share`.
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
    """Removes the contacts' pushes from the forces that the next step uses.

    Args:
        mass: mass of the free vertices.
        dynamics: scheme and damping of the steps.
        scheme: scheme of the simulation. ``bdf2`` has no pushes, because it damps motion that contacts excite. Contacts
            between rigid bodies and obstacles have `Impacts` instead, except with ``newmark``.
    """

    def __init__(self, mass: FreeMass, dynamics: Dynamics, scheme: Scheme) -> None:
        self._mass, self._dynamics, self._scheme = mass, dynamics, scheme

    def fit(self, before: State, h: float, contacts: Sequence[ContactTerm]) -> None:
        """Set the contacts' ratio of force to multiplier for a step of length ``h`` [s] from ``before``."""
        for contact in contacts:
            pushes = self._are_of(contact)
            contact.share = rule_of(self._dynamics, h, before.terms[NAME]).share if pushes else 1.0

    def forgotten(self, before: State, now: State, h: float, contacts: Sequence[ContactTerm]) -> State:
        """Return ``now``, the state after a step of length ``h`` [s] from ``before``, with pushes stored separately."""
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
