# SPDX-License-Identifier: Apache-2.0
"""Impulse of the contacts in a step.

The positions at the end of a step keep the laws of contact, with multipliers R. A scheme of second order would go on
with these forces after the body has left the contact, and throw it back. Positions and velocities are therefore treated
apart, as Bruels, Acary and Cardona (2014) do: the multipliers displace the body by d = M^-1 R / kappa in this step, and
nothing else. The velocity without them, v - theta d, gets the impulses L with which the velocities keep the laws at the
points that press:

    L_n >= 0,  v_n + e v_0 >= 0,  L_n (v_n + e v_0) = 0,  |L_t| <= mu L_n, against the slip,

with v_0 the speed of approach at the beginning of the step, or without L if that is slower, and e the restitution. The
published forces are L / h.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver import outcome
from gdfe_ros.solver.contact.complementarity import solve_laws
from gdfe_ros.solver.contact.compliance import join, project, pull
from gdfe_ros.solver.contact.contact_term import ROUNDING, ContactTerm
from gdfe_ros.solver.contact.stencil import pad_columns
from gdfe_ros.solver.motion.inertia import NAME, FreeMass
from gdfe_ros.solver.motion.scheme import Kinematics, Rule
from gdfe_ros.solver.settings import Dynamics
from gdfe_ros.solver.state import State, changed

Array = NDArray[np.float64]


class Pressing(NamedTuple):
    """Points of one contact that press at the end of a step.

    Attributes:
        contact: the term.
        chosen: (k,) their places among the near points.
        axes: (k, 3, 3) unit normals and tangents.
        ends: (k, c) vertices that move the points.
        blocks: (k, c, 3, 3) derivatives of gaps and slips with respect to these vertices.
        led: (k, 3) [m] displacement of what commanded poses move.
        first: (k, 3) [N] multipliers along the axes.
        soft: (k,) [m/N] compliance of springs.
    """

    contact: ContactTerm
    chosen: NDArray[np.int64]
    axes: Array
    ends: NDArray[np.int64]
    blocks: Array
    led: Array
    first: Array
    soft: Array

    @classmethod
    def of(cls, contact: ContactTerm, positions: Array, before: State) -> Pressing:
        """Return the points of ``contact`` that press at ``positions`` (n, 3) [m] after the state ``before``."""
        found = contact.present_stencils(positions)
        on = np.flatnonzero(found.held[:, 0] > 0.0)
        axes, held = found.axes[on], found.held[on]
        length = np.linalg.norm(axes[:, 0], axis=1)  # below 1 at edges of a surface of triangles
        axes[:, 0] /= length[:, None]
        held[:, 0] *= length
        weights = np.stack([found.pressing[on], found.rubbing[on], found.rubbing[on]], axis=2)
        blocks, led = weights[..., None] * axes[:, None], contact.led(positions, before)[on]
        return cls(contact, on, axes, found.ends[on], blocks, np.einsum("kai,ki->ka", axes, led), held, found.soft[on])


class ContactImpulses:
    """Finds the impulses of the contacts of a body.

    Args:
        mass: mass of the free vertices and of the rigid bodies.
    """

    EXACT = 1e-10
    """Violation of the laws that is looked for, divided by the largest speed of a point that presses."""
    FAINT = 1e-7
    """Such a violation that counts as nothing, if `EXACT` is out of reach: forces of stacks are far from unique."""
    SETTLED = 1e-5
    """Largest such violation with which a step has converged."""
    OPPOSED, LISTED = 0.5, 5
    """A grip presses from opposite sides if the sum of its normal impulses is at most this fraction of their lengths'
    sum. A message names the second number of vertices.
    """

    LACKING = 1.001
    """Least friction that would hold a body in a grip, divided by the grip's own, at which a step names the slip."""

    def __init__(self, mass: FreeMass) -> None:
        self._mass = mass

    def add(self, dynamics: Dynamics, before: State, now: State, h: float, contacts: Sequence[ContactTerm]) -> State:
        """Return ``now``, the state after a step of length ``h`` [s] from ``before``, with velocities by impulses."""
        acting, x, saved = [contact for contact in contacts if contact.acts], now.positions, now.terms[NAME]
        if not (acting and any(contact.near for contact in contacts)):
            return now
        rule, multipliers = Rule.of(dynamics, h, Kinematics.of(before.terms[NAME])), np.zeros_like(x)
        for contact in acting:
            contact.add_forces(multipliers)
        moved = self._mass.accelerated(multipliers, x) / rule.kappa
        velocity = saved["velocity"] - rule.theta * moved
        parts = [Pressing.of(contact, x, before) for contact in acting]
        gained, now = self._strike(parts, velocity, 2.0 / (rule.kappa * h), before, now, h)
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
        self, parts: Sequence[Pressing], velocity: Array, time: float, before: State, now: State, h: float
    ) -> tuple[Array, State]:
        """Return the change (n, 3) [m/s] of ``velocity`` by the impulses, and ``now`` with the mean forces.

        ``time`` [s] times the multipliers are the impulses if the contacts push steadily.
        """
        sizes, contacts = [len(part.chosen) for part in parts], [part.contact for part in parts]
        count, vertices = sum(sizes), np.unique(np.concatenate([part.ends.ravel() for part in parts]))
        if not count:
            return np.zeros_like(velocity), now
        friction = np.repeat([float(contact.friction) for contact in contacts], sizes)
        restitution = np.repeat([float(contact.restitution) for contact in contacts], sizes)
        width = max(part.ends.shape[1] for part in parts)
        rows = pad_columns([np.searchsorted(vertices, part.ends) for part in parts], width)
        blocks = pad_columns([part.blocks for part in parts], width)
        counts = np.repeat([part.ends.shape[1] for part in parts], sizes)
        given, (came, speeds) = (rows, blocks, counts), np.empty((2, count, 3))
        w, led = np.empty((3 * count, 3 * count)), np.concatenate([part.led for part in parts]) / h
        for found, of in ((came, before.terms[NAME]["velocity"]), (speeds, velocity)):
            project(of[vertices].ravel(), *given, found)
            found -= led
        speeds[:, 0] += restitution * np.minimum(np.maximum(came[:, 0], speeds[:, 0]), 0.0)
        between, every = self._mass.inverse(now.positions, vertices), np.arange(count)
        join(every, *given, np.arange(len(vertices)), between, np.zeros((0, 9)), w)
        w[3 * every, 3 * every] += np.concatenate([part.soft for part in parts]) / h**2
        impulses, scale = time * np.concatenate([part.first for part in parts]).ravel(), float(np.abs(speeds).max())
        left = solve_laws(w, speeds.ravel(), friction, impulses, self.EXACT * scale, self.FAINT * scale)
        slips = (speeds.ravel() + w @ impulses).reshape(-1, 3)[:, 1:] - came[:, 1:]
        now = self._told(parts, impulses.reshape(-1, 3), slips, now, left if left > self.SETTLED * scale else 0.0)
        pulls, impulses = np.zeros_like(velocity), impulses.reshape(-1, 3)
        local = np.zeros(3 * len(vertices))
        pull(impulses, *given, local)
        pulls[vertices] = local.reshape(-1, 3)
        return self._mass.accelerated(pulls, now.positions), _publish(parts, impulses / h, before, now)

    def _told(self, parts: Sequence[Pressing], impulses: Array, slips: Array, now: State, left: float) -> State:
        """Return ``now`` with sentences about grips that slip, and about laws that are violated by ``left`` [m/s].

        ``impulses`` (k, 3) [N s] and changes ``slips`` (k, 2) [m/s] of the slip speeds are those of all points.
        """
        texts, ends = [now.summary.message], np.cumsum([len(part.chosen) for part in parts])[:-1]
        for part, own, gained in zip(parts, np.split(impulses, ends), np.split(slips, ends), strict=True):
            texts.append(self._find_slip(part, own, gained))
        if left:
            names = ", ".join(part.contact.name for part in parts if len(part.chosen))
            text = f"the impulses of the contacts {names} leave {left:.3g} m/s; remedy: a smaller dynamics.step"
            texts.append(text)
        converged = now.summary.converged and not left
        return now.with_(summary=changed(now.summary, converged=converged, message=outcome.join(*texts)))

    def _find_slip(self, part: Pressing, impulses: Array, gained: Array) -> str:
        """Return a sentence if a rigid body slips out of a grip, with the friction that would hold it; else "".

        A grip presses on a body from opposite sides, and all of its points slip. ``impulses`` (k, 3) [N s] are those of
        the points. The missing one is the body's mass times the mean of the slip speeds ``gained`` (k, 2) [m/s].
        """
        friction, mass = part.contact.friction, part.contact.held_mass
        if not mass:
            return ""
        push, rub = impulses[:, 0], np.einsum("ka,kai->ki", impulses[:, 1:], part.axes[:, 1:])
        squeezed = np.linalg.norm(push @ part.axes[:, 0]) < self.OPPOSED * push.sum()
        sticks = np.linalg.norm(rub, axis=1) < (1.0 - ROUNDING) * friction * push
        if not squeezed or sticks.any():
            return ""
        slips = np.einsum("ka,kai->ki", gained, part.axes[:, 1:])
        needed = float(np.linalg.norm(rub.sum(axis=0) - mass * slips.mean(axis=0)) / push.sum())
        if not needed > self.LACKING * friction:
            return ""
        where = ", ".join(map(str, np.unique(part.ends[push > 0.0, 0])[: self.LISTED]))
        text = f"{part.contact.name} slips out of its grip at vertices {where}: its friction is {friction:.4g}"
        return f"{text}, and about {needed:.4g} would hold it"


def _publish(parts: Sequence[Pressing], forces: Array, before: State, now: State) -> State:
    """Return ``now`` with the mean forces (k, 3) [N] of the points in the contacts' states and in the reactions.

    The work of obstacles on rigid bodies, which no reaction contains, is added to the ledger.
    """
    terms, reactions, first, work = dict(now.terms), dict(now.summary.reactions), 0, now.ledger.work
    for part in parts:
        contact, last = part.contact, first + len(part.chosen)
        pushes, shears, own = np.zeros(contact.count), np.zeros((contact.count, 3)), forces[first:last]
        pushes[part.chosen] = own[:, 0]
        shears[part.chosen] = np.einsum("ka,kai->ki", own[:, 1:], part.axes[:, 1:])
        name, first = contact.name, last
        terms[name] = contact.exerted(before.terms[name], terms[name], pushes, shears)
        if contact.on_body:
            reactions[name] = contact.wrench(now.positions, terms[name])
        else:
            work += float(np.vdot(own, part.led))
    ledger = changed(now.ledger, work=work)
    return now.with_(terms=terms, summary=changed(now.summary, reactions=reactions), ledger=ledger)
