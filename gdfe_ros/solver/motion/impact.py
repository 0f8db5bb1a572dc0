# SPDX-License-Identifier: Apache-2.0
"""Impacts of rigid bodies: contact forces that stop a body within one step act once, as impulses.

A scheme of second order assumes that the force of a step acted before the step and continues after it. A contact force
that stops a rigid body in one step would therefore throw the body back, with BDF2 at up to 1.25 times its speed. The
fraction of each contact force that cancels the speed of approach is thus treated as an impulse. It displaces the body
by d in that step, changes its velocity by d / h, and does not enter the next step. The rest, such as the weight of a
body at rest, is an ordinary force. The fraction is the same for both bodies in contact, so momentum is conserved.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.rigid_contact import RigidContact
from gdfe_ros.solver.motion.dynamics import Dynamics, Scheme
from gdfe_ros.solver.motion.inertia import NAME, kinematics_of, rule_of
from gdfe_ros.solver.motion.rigid_part import rigid_part
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
