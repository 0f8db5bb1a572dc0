# SPDX-License-Identifier: Apache-2.0
"""Impulse of the contacts in a step.

The positions at the end of a step satisfy the laws of contact, with multipliers R. A scheme of second order would use
these forces in the next step, too, and throw the body back. Positions and velocities are therefore treated separately,
as in Bruels, Acary and Cardona (2014). The multipliers only displace the body in this step, by d = M^-1 R / kappa. This
displacement is left out of the velocity, which becomes v - theta d. Impulses L then change the velocity so that it
satisfies the laws at the points that press:

    L_n >= 0,  v_n + e v_0 >= 0,  L_n (v_n + e v_0) = 0,  |L_t| <= mu L_n, against the slip,

with the restitution e. v_0 <= 0 is the normal velocity of approach at the beginning of the step, or that without L if
it is slower. The published forces are L / h.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver import outcome
from gdfe_ros.solver.contact.complementarity import solve_laws
from gdfe_ros.solver.contact.compliance import join
from gdfe_ros.solver.contact.contact_term import SLIP_MARGIN, ContactTerm
from gdfe_ros.solver.contact.field import HeldLoads, project, pull
from gdfe_ros.solver.contact.stencil import add_loads, find_pressing
from gdfe_ros.solver.motion.inertia import NAME, FreeMass
from gdfe_ros.solver.motion.scheme import Kinematics, Rule
from gdfe_ros.solver.settings import Dynamics
from gdfe_ros.solver.state import State, replace_fields
from gdfe_ros.solver.vectors import Array


class Pressing(NamedTuple):
    """The points of all contacts that press at the end of a step.

    Attributes:
        parts: for each contact with points that press: the contact, the slice of its points in the arrays below, and
            the indices of these points among the near points of the contact.
        axes: (k, 3, 3) unit normals and tangents.
        vertices: (k, c) vertices that move the points.
        blocks: (k, c, 3, 3) derivatives of gaps and slips with respect to these vertices.
        led: (k, 3) [m] displacements of the touched surfaces by commanded poses, in components along the axes.
        first: (k, 3) [N] multipliers in components along the axes.
        soft, friction, restitution: (k,) compliances of the points' springs [m/N], and coefficients of their contacts.
    """

    parts: list[tuple[ContactTerm, slice, NDArray[np.int64]]]
    axes: Array
    vertices: NDArray[np.int32]
    blocks: Array
    led: Array
    first: Array
    soft: Array
    friction: Array
    restitution: Array

    @classmethod
    def of(cls, held: HeldLoads, positions: Array, before: State) -> Pressing:
        """Return the points that press at ``positions`` (n, 3) [m] after the state ``before``."""
        field = held.gather()
        on, parts = np.flatnonzero(field.stencils.held[:, 0] > 0.0), []
        axes, held_along, led = np.empty((len(on), 3, 3)), *np.zeros((2, len(on), 3))
        blocks = np.empty((len(on), field.stencils.ends.shape[1], 3, 3))
        find_pressing(positions, field.surfaces, field.owner, field.stencils, on, axes, held_along, blocks)
        for contact, (first, last) in zip(held.contacts, held.parts, strict=True):
            begin, end = np.searchsorted(on, (first, last))
            if end > begin:
                own, numbers = slice(begin, end), on[begin:end] - first
                parts.append((contact, own, numbers))
                led[own] = np.einsum("kai,ki->ka", axes[own], contact.find_led_motion(positions, before)[numbers])
        more = field.stencils.soft[on], field.friction[on], field.restitution[on]
        return cls(parts, axes, field.stencils.ends[on], blocks, led, held_along, *more)


class ContactImpulses:
    """Finds the impulses of the contacts of a body.

    Args:
        mass: mass of the free vertices and of the rigid bodies.
    """

    EXACT = 1e-10
    """Target for the violation of the laws, divided by the largest speed of a point that presses."""
    FAINT = 1e-7
    """Violation, divided by the same speed, that is accepted if `EXACT` cannot be reached: forces in stacks are not
    unique.
    """
    SETTLED = 1e-5
    """Largest violation, divided by the same speed, with which a step counts as converged."""
    OPPOSED, LISTED = 0.5, 5
    """A body is gripped from opposite sides if the length of the sum of the normal impulses is less than the first
    number times the sum of their lengths. A message names at most the second number of vertices.
    """

    LACKING = 1.001
    """A step reports a slip if the friction that would hold the body, divided by the actual friction, exceeds this."""

    def __init__(self, mass: FreeMass) -> None:
        self._mass = mass

    def add(self, dynamics: Dynamics, before: State, now: State, h: float, held: HeldLoads) -> State:
        """Return ``now``, the state after a step of length ``h`` [s] from ``before``, with velocities after impulses.

        ``held`` has the near points of the contacts, and their stencils at the positions of ``now``.
        """
        if not any(contact.acts and contact.near for contact in held.contacts):
            return now
        part, x, saved = Pressing.of(held, now.positions, before), now.positions, now.terms[NAME]
        loads, rule = np.zeros_like(x), Rule.of(dynamics, h, Kinematics.of(before.terms[NAME]))
        add_loads(held.gather().stencils, loads)
        self._mass.include(part.vertices)
        moved = self._mass.respond(x, -loads) / rule.kappa
        velocity = saved["velocity"] - rule.theta * moved
        pulls, now = self._strike(part, velocity, 2.0 / (rule.kappa * h), before, now, h)
        gained = self._mass.respond(x, pulls)
        kept = {
            **saved,
            "velocity": velocity + gained,
            "acceleration": saved["acceleration"] - rule.kappa_a * moved + gained / h,
            "balanced": saved["balanced"] - rule.kappa * moved,
            "before": saved["before"] + moved - h * gained,
            "velocity_before": saved["velocity_before"] + gained,
            "pushed": gained / h,
        }
        return now.with_(terms={**now.terms, NAME: kept})

    def _strike(
        self, part: Pressing, velocity: Array, time: float, before: State, now: State, h: float
    ) -> tuple[Array, State]:
        """Return the impulses (n, 3) [N s] on all vertices that change ``velocity``, and ``now`` with the mean forces.

        The first guess of the impulses, exact for contacts that push steadily, is ``time`` [s] times the multipliers.
        """
        (place, between), (count, width) = self._mass.inverse(now.positions), part.vertices.shape
        given, every = (part.vertices.astype(np.int64), part.blocks, np.full(count, width)), np.arange(count)
        came, speeds, w = *np.empty((2, count, 3)), np.empty((3 * count, 3 * count))
        for found, of in ((came, before.terms[NAME]["velocity"]), (speeds, velocity)):
            project(of.ravel(), *given, found)
            found -= part.led / h
        speeds[:, 0] += part.restitution * np.minimum(np.maximum(came[:, 0], speeds[:, 0]), 0.0)
        join(every, *given, place, between, np.zeros((0, 9)), w)
        w[3 * every, 3 * every] += part.soft / h**2
        impulses, scale = time * part.first.ravel(), float(np.abs(speeds).max())
        left = solve_laws(w, speeds.ravel(), part.friction, impulses, self.EXACT * scale, self.FAINT * scale)
        slips = (speeds.ravel() + w @ impulses).reshape(-1, 3)[:, 1:] - came[:, 1:]
        pulls, impulses = np.zeros_like(velocity), impulses.reshape(-1, 3)
        now = self._add_texts(part, impulses, slips, now, left if left > self.SETTLED * scale else 0.0)
        pull(impulses, *given, pulls.reshape(-1))
        return pulls, _publish(part, impulses / h, before, now)

    def _add_texts(self, part: Pressing, impulses: Array, slips: Array, now: State, left: float) -> State:
        """Return ``now`` with messages about grips that slip, and about a violation ``left`` [m/s] of the laws.

        ``impulses`` (k, 3) [N s] and the changes ``slips`` (k, 2) [m/s] of the slip speeds have rows for all points
        that press.
        """
        grips = (self._find_slip(contact, part, own, impulses[own], slips[own]) for contact, own, _ in part.parts)
        texts = [now.summary.message, *grips]
        if left:
            names = ", ".join(contact.name for contact, _, _ in part.parts)
            texts.append(f"the impulses of the contacts {names} leave {left:.3g} m/s; remedy: a smaller dynamics.step")
        converged = now.summary.converged and not left
        return now.with_(summary=replace_fields(now.summary, converged=converged, message=outcome.join(*texts)))

    def _find_slip(self, contact: ContactTerm, part: Pressing, own: slice, impulses: Array, gained: Array) -> str:
        """Return a message, with the needed friction, if a rigid body slips out of a grip; otherwise an empty one.

        The body slips if it is pressed from opposite sides, and all points slip. ``impulses`` (k, 3) [N s] and the
        changes ``gained`` (k, 2) [m/s] of the slip speeds have rows for the contact's ``own`` points. The missing
        impulse is the body's mass times the mean of these changes.
        """
        friction, mass, axes, push = contact.friction, contact.held_mass, part.axes[own], impulses[:, 0]
        if not mass or (np.linalg.norm(impulses[:, 1:], axis=1) < (1.0 - SLIP_MARGIN) * friction * push).any():
            return ""
        if not np.linalg.norm(push @ axes[:, 0]) < self.OPPOSED * push.sum():
            return ""
        rub = np.einsum("ka,kai->i", impulses[:, 1:], axes[:, 1:])
        slips = np.einsum("ka,kai->ki", gained, axes[:, 1:])
        needed = float(np.linalg.norm(rub - mass * slips.mean(axis=0)) / push.sum())
        if not needed > self.LACKING * friction:
            return ""
        where = ", ".join(map(str, np.unique(part.vertices[own][push > 0.0, 0])[: self.LISTED]))
        text = f"{contact.name} slips out of its grip at vertices {where}: its friction is {friction:.4g}"
        return f"{text}, and about {needed:.4g} would hold it"


def _publish(part: Pressing, forces: Array, before: State, now: State) -> State:
    """Return ``now`` with the step's mean contact ``forces`` (k, 3) [N] in the contacts' states and in the reactions.

    Reactions lack forces on rigid bodies. The work of obstacles on rigid bodies is therefore added to the ledger here.
    """
    terms, reactions, work = dict(now.terms), dict(now.summary.reactions), now.ledger.work
    rubs = np.einsum("ka,kai->ki", forces[:, 1:], part.axes[:, 1:])
    for contact, own, numbers in part.parts:
        pushes, shears, name = np.zeros(contact.count), np.zeros((contact.count, 3)), contact.name
        pushes[numbers], shears[numbers] = forces[own, 0], rubs[own]
        terms[name] = contact.add_mean_forces(before.terms[name], terms[name], pushes, shears)
        if contact.on_body:
            reactions[name] = contact.wrench(now.positions, terms[name])
        else:
            work += float(np.vdot(forces[own], part.led[own]))
    ledger = replace_fields(now.ledger, work=work)
    return now.with_(terms=terms, summary=replace_fields(now.summary, reactions=reactions), ledger=ledger)
