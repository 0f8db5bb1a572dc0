# SPDX-License-Identifier: Apache-2.0
"""Impacts of rigid bodies: what stops them within a step acts once.

A scheme of second order takes the force of a step for one that was there before and goes on after it: what stops a
rigid body at something hard in one step would throw it back, by BDF2 with up to 1.25 times its speed. So of the force
of each contact of rigid bodies the share that is spent on the speed with which it approached counts as an impulse: it
moves the body by d in that step, changes its velocity by d / h, and is forgotten. What is left, as the weight of a body
at rest, is a force as any other. On both sides the share is the same: momentum is kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.rigid_contact import RigidContact
from gdfe_ros.solver.motion.dynamics import Dynamics, Scheme
from gdfe_ros.solver.motion.inertia import NAME, kinematics_of, rule_of
from gdfe_ros.solver.motion.rigid_part import rigid_part
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import Term


class Impacts:
    """Has impacts of a body's rigid bodies act once.

    Args:
        body: the discretised body.
        dynamics: of the steps.
        scheme: whose next step counts on what is left; with ``newmark`` all contacts push as `Pushes` has it.
    """

    def __init__(self, body: Body, dynamics: Dynamics, scheme: Scheme) -> None:
        rigid = [handle for handle in body.handles if isinstance(handle, RigidBody)]
        self._dynamics = dynamics
        self._vertices = np.array([handle.vertices for handle in rigid], dtype=np.int32).reshape(-1, 4)
        self._masses = np.array([0.25 * handle.mass for handle in rigid])[:, None, None]
        self._happen = bool(rigid) and scheme is not Scheme.NEWMARK

    def stopped(self, before: State, now: State, h: float, contacts: Sequence[Term], *, first: bool) -> State:
        """Return the state after a step of length ``h`` [s] from ``before``, with impacts as impulses.

        There are none in the ``first`` step: how anything approached is not known yet.
        """
        touching = [contact for contact in contacts if isinstance(contact, RigidContact) and contact.updates]
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
        # What it moved by, not its velocity: that of a body at rest must be exactly none.
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
        """Return by how much forces (n, 3) [N] move the vertices of rigid bodies in a step (n, 3) [m]."""
        moved, own = np.zeros_like(x), self._vertices
        moved[own] = rigid_part(x[own], forces[own] / (kappa * self._masses))
        return moved
