# SPDX-License-Identifier: Apache-2.0
"""Contact forces of rigid bodies that act once, as impulses, and those that are constant over a step.

A scheme of second order assumes that the force of a step acted before the step and continues after it. A contact force
that stops a rigid body in one step would therefore throw the body back, with BDF2 at up to 1.25 times its speed. The
fraction of each contact force that cancels the speed of approach is thus treated as an impulse. It displaces the body
by d in that step, changes its velocity by d / h, and does not enter the next step. The rest, such as the weight of a
body at rest, is an ordinary force. The fraction is the same for both bodies in contact, so momentum is conserved.

Other contacts push with one force F throughout the step, which does not enter the next step either: if the body has
left the contact by then, it would create energy. A solve finds the multiplier: the force at the end of the step that
causes the same displacement as F. The ratio of F to the multiplier is the rule's `share`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact_term import ContactTerm
from gdfe_ros.solver.contact.rigid_contact import RigidContact
from gdfe_ros.solver.motion.dynamics import Dynamics, Scheme
from gdfe_ros.solver.motion.inertia import NAME, FreeMass, kinematics_of, rigid_part, rule_of
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import Term


class Impacts:
    """Treats impacts of a body's rigid bodies as impulses.

    Args:
        body: the discretised body.
        dynamics: scheme and damping of the steps.
        scheme: scheme of the next step, which uses the forces without impacts. With ``newmark``, `Pushes` treats all
            contacts and there are no impacts.
    """

    def __init__(self, body: Body, dynamics: Dynamics, scheme: Scheme) -> None:
        rigid = body.rigid_bodies
        self._dynamics = dynamics
        self._vertices = np.array([handle.vertices for handle in rigid], dtype=np.int32).reshape(-1, 4)
        self._masses = np.array([0.25 * handle.mass for handle in rigid])[:, None, None]
        self._happen = bool(rigid) and scheme is not Scheme.NEWMARK

    def stopped(self, before: State, now: State, h: float, contacts: Sequence[Term], *, first: bool) -> State:
        """Return the state after a step of length ``h`` [s] from ``before``, with impacts as impulses.

        The ``first`` step has no impacts, because the speed of approach is not known yet.
        """
        touching = [contact for contact in contacts if isinstance(contact, RigidContact) and contact.near]
        last = kinematics_of(before.terms[NAME])
        if not (self._happen and touching) or first:
            return now
        rule, x = rule_of(self._dynamics, h, before.terms[NAME]), now.positions
        impulsive, moved = np.zeros_like(x), []
        for contact in touching:
            forces = np.zeros_like(x)
            contact.add_forces(x, forces)
            moved.append(self._moved(x, forces, rule.kappa))
        together = sum(moved)
        # The displacement of the last step instead of the velocity: for a body at rest it is exactly zero.
        approach = (h / before.terms[NAME]["h"][0]) * (before.positions - last.before)
        for contact, alone in zip(touching, moved, strict=True):
            contact.add_impacts(x, before, approach, (together, alone), impulsive)
        if not impulsive.any():
            return now
        change, saved = self._moved(x, impulsive, rule.kappa), now.terms[NAME]
        kept = {
            **saved,
            "velocity": saved["velocity"] - (rule.theta - 1.0 / h) * change,
            "acceleration": saved["acceleration"] - rule.kappa_a * change,
            "balanced": saved["balanced"] - rule.kappa * change,
            "velocity_before": saved["velocity_before"] + change / h,
        }
        return now.with_(terms={**now.terms, NAME: kept})

    def _moved(self, x: NDArray[np.float64], forces: NDArray[np.float64], kappa: float) -> NDArray[np.float64]:
        """Return the displacement (n, 3) [m] of rigid bodies' vertices by forces (n, 3) [N] in a step."""
        moved, own = np.zeros_like(x), self._vertices
        moved[own] = rigid_part(x[own], forces[own] / (kappa * self._masses))
        return moved


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
