# SPDX-License-Identifier: Apache-2.0
"""The external terms of a body, their commands, and the reactions of handles and obstacles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import Actuator, ActuatorState, Cable, Chamber, Grip, Growth
from gdfe_ros.actuators.load import Load, PressureLoad
from gdfe_ros.compiled import kernel
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import rigid_pairs
from gdfe_ros.materials.tensor import scale_vector
from gdfe_ros.mesh.triples import corner, cross, minus, plus
from gdfe_ros.solver.body import Body, Growths
from gdfe_ros.solver.contact.contact import Contact
from gdfe_ros.solver.contact.contact_surface import ContactSurface
from gdfe_ros.solver.contact.contact_term import ContactTerm
from gdfe_ros.solver.contact.field import HeldLoads
from gdfe_ros.solver.contact.rigid_contact import RigidContact, RoundContact
from gdfe_ros.solver.contact.self_contact.own_contact import OwnContact
from gdfe_ros.solver.elements.blocks import Operators
from gdfe_ros.solver.forces.grip import GripTerm
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.matrix.unknowns import vertex_force
from gdfe_ros.solver.state import Balance, Saved, State, Summary
from gdfe_ros.solver.terms.applied_load import DeadLoadTerm, PressureTerm
from gdfe_ros.solver.terms.cable import CableTerm
from gdfe_ros.solver.terms.chamber import ChamberTerm
from gdfe_ros.solver.terms.term import Term, TermTable
from gdfe_ros.solver.vectors import NEGLIGIBLE, Array

TERMS = {Cable: CableTerm, Chamber: ChamberTerm, Grip: GripTerm}
"""Dict from each class of actuators to its class of terms, in the order in which energies are summed. Growths have no
terms.
"""


class Actuation:
    """The terms of a body other than its elements.

    Args:
        body: the discretised body.
        actuators: actuators of the scene.
        loads: dead loads and follower pressures; the command of each is its factor.
        terms: further terms.

    Attributes:
        body, actuators: the arguments.
        terms: all terms, loads first.
        table: all terms in the layout of the kernels.
        strung: cables with a commanded length and two or more points on handles or in the world. Such a cable cannot be
            shorter than the distance between these points.
        growths: the growths, which change the elements' rest shape.
        grips: the grips.
        neutral: dict from actuator or load name to the command without effect.
        loaded: names of the loads.
        contacts: contact terms of the obstacles, and the self-contact term.
        held: the near points of all contacts, with the dead loads that represent the contact forces.
    """

    def __init__(
        self, body: Body, actuators: Sequence[Actuator] = (), loads: Sequence[Load] = (), terms: Sequence[Term] = ()
    ) -> None:
        self.body, self.actuators = body, tuple(actuators)
        self._loads = [(PressureTerm if isinstance(load, PressureLoad) else DeadLoadTerm)(load, body) for load in loads]
        driven = [term(item, body) for kind, term in TERMS.items() for item in actuators if isinstance(item, kind)]
        self.strung = [term for term in driven if isinstance(term, CableTerm) and term.strung]
        self.grips = [term for term in driven if isinstance(term, GripTerm)]
        self.contacts = contacts_of(body)
        self._more = tuple(terms)
        self._commanded = *self._loads, *driven
        self.terms: tuple[Term, ...] = *self._commanded, *self.contacts, *self._more
        self.held = HeldLoads(body, self.contacts)
        self.table = TermTable.pack((*self.terms, self.held) if self.contacts else self.terms)
        self.growths = Growths(body, self.actuators)
        self._driven = {term.name: term for term in driven}
        self.loaded = tuple(item.name for item in self._loads)
        self.neutral = {item.name: item.neutral(body.rest) for item in self.actuators} | dict.fromkeys(self.loaded, 0.0)

    @property
    def updates(self) -> bool:
        """Whether a multiplier is updated between minimisations."""
        return any(term.updates for term in self.terms)

    def fit(self, matrix: ConstantMatrix) -> None:
        """Set penalties and compliances of all terms in proportion to the body's stiffness (`Term.fit`)."""
        for term in self.terms:
            term.fit(matrix)

    def at_rest(self) -> dict[str, Saved]:
        """Return the initial stored states of all terms."""
        return {term.name: term.neutral() for term in self.terms}

    def rest_state(self, *, converged: bool, message: str = "", **more: object) -> State:
        """Return the state of the undeformed body at neutral commands, with further fields ``more``."""
        body, grown, loose = self.body, self.growths.ungrown, np.zeros((len(self.body.unknowns.slides), 3))
        return State(
            positions=body.rest,
            base=body.rest,
            poses={handle.name: Pose() for handle in body.handles},
            commands=dict(self.neutral),
            slides=loose,
            turns=loose,
            operators=grown,
            summary=Summary(
                converged=converged,
                message=message,
                error_estimate=0.0,
                energy=0.0,
                min_det=1.0,
                reactions={handle.name: np.zeros(6) for handle in body.handles},
                actuators=self.states(body.rest, self.neutral, grown),
            ),
            **more,
        )

    def begin(
        self,
        commands: Mapping[str, float],
        saved: Mapping[str, Saved],
        positions: Array,
        poses: Mapping[str, Pose] | None = None,
        last: State | None = None,
        *,
        ratio: float = 0.0,
    ) -> None:
        """Prepare all terms for a solve with the arguments of `Term.begin`; ``saved`` is a dict from term name.

        If ``poses`` of handles and obstacles are given, they and the previous state ``last`` are first passed to
        `Term.set_targets`.
        """
        for term in self.terms:
            if poses is not None:
                term.set_targets(poses, last)
            if self.grips and isinstance(term, Contact):  # grips come before contacts
                term.leave_out([pair for grip in self.grips for pair in grip.pairs])
            term.begin(commands, saved[term.name], positions, ratio)
        if self.contacts:
            self.held.set_loads(positions)

    def update(self, positions: Array) -> float:
        """Update the multipliers; return the largest error of a constraint, divided by the body's size."""
        misses = [term.update(positions) for term in self.terms if term.updates]
        return max(misses, default=0.0) / self.body.size

    def flaw(self, positions: Array) -> str:
        """Return a message if a term rejects ``positions`` (n, 3) [m] of a solve; empty if all accept them."""
        return "; ".join(text for term in self.contacts if (text := term.flaw(positions)))

    @property
    def wanders(self) -> bool:
        """Whether updates of a term do not settle, so that the increment should be shorter."""
        return any(term.wanders for term in self.terms)

    def finish(self, saved: Mapping[str, Saved], positions: Array, *, moving: bool) -> dict[str, Saved]:
        """Return a dict from term name to the state to store after a solve that ended at ``positions`` (n, 3) [m].

        If the body is ``moving``, contacts get their mean forces from the impulses of the step.
        """
        if self.contacts:
            self.held.look(positions)
        found = {term.name: term.finish(saved[term.name], positions) for term in self.terms}
        for contact in (each for each in self.contacts if each.acts and not moving):
            found[contact.name] = contact.add_multipliers(saved[contact.name], found[contact.name])
        return found

    def unstable(
        self, positions: Array, since: Array, commands: Mapping[str, float], before: Mapping[str, float] | None = None
    ) -> Actuator | None:
        """Return an actuator that passed its limit point in a failed solve; None if there is none.

        ``since`` (n, 3) [m] are the positions of the last equilibrium, ``positions`` (n, 3) [m] those after the failed
        solve. If the energy has no lower bound, ``positions`` have no meaning. The caller then gives ``before``, the
        commands before the solve, and the first unbounded actuator whose command has grown is returned.
        """
        for name, term in self._driven.items():
            grew = before is not None and term.unbounded and abs(commands[name]) > abs(before[name])
            if grew or term.ran_away(positions, since):
                return term.actuator
        return None

    def unreachable(self, base: Array, commands: Mapping[str, float]) -> str:
        """Return a message if a cable's commanded length is below the distance of its fixed points; empty if not.

        ``base`` (n, 3) [m] has the commanded positions of the handles.
        """
        for term in self.strung:
            least, wanted = term.shortest(base), term.find_target_length(commands[term.name])
            if wanted < least * (1.0 - NEGLIGIBLE):
                return (
                    f"cable {term.name!r} is commanded to a length of {wanted:.6g} m, but the handles that it runs "
                    f"between are {least:.6g} m apart; remedy: command at least that, or bring the handles nearer"
                )
        return ""

    def holding(self, state: State) -> list[str]:
        """Return the names of the grips that hold something in ``state``."""
        return [grip.name for grip in self.grips if grip.holds(state.terms[grip.name])]

    def states(self, positions: Array, commands: Mapping[str, float], operators: Operators) -> dict[str, ActuatorState]:
        """Return a dict from actuator name to its state; ``positions`` (n, 3) [m] are the result of the last solve."""
        return {
            item.name: self.growths.state(item, commands, operators)
            if isinstance(item, Growth)
            else self._driven[item.name].state(positions)
            for item in self.actuators
        }

    def reports(self, positions: Array) -> dict[str, dict[str, float]]:
        """Return a dict from the name of a user-defined term to its report."""
        return {term.name: report for term in self._more if (report := term.report(positions))}

    def balance(self, positions: Array, commands: Mapping[str, float]) -> Balance:
        """Return the terms' potential [J] at ``positions`` (n, 3) [m], and its derivative with respect to each command.

        The potential is zero while the body is undeformed. A length or volume that a multiplier keeps has no potential.
        The derivative with respect to a commanded volume is the multiplier; with respect to a commanded length, it is
        minus the multiplier.
        """
        found = {term.name: term.potential(positions, commands[term.name]) for term in self._commanded}
        more = sum(term.energy(positions) for term in self._more)
        return Balance(
            potential=more + sum(potential for potential, _ in found.values()),
            slopes={name: slope for name, (_, slope) in found.items()},
        )


def contacts_of(body: Body) -> list[ContactTerm]:
    """Return all contact terms: of the soft body with obstacles, rigid bodies and itself, and of each rigid body."""
    touched = [handle for handle in body.handles if isinstance(handle, Obstacle)]
    surface, found = ContactSurface.of(body) if touched else None, []
    for thing in touched:
        found.append(Contact(thing.name, thing, body, surface, friction=thing.friction, restitution=thing.restitution))
    for rigid, thing in rigid_pairs(touched):
        kind = RoundContact if rigid.form.rounding > 0.0 else RigidContact
        found.append(kind(rigid, thing, body))
    if body.self_contact is not None:
        found.append(OwnContact(body.self_contact, body))
    return found


def tell_limit_point(actuator: Actuator, last: Mapping[str, float], commands: Mapping[str, float]) -> str:
    """Return the message that an actuator lost its stability between two commands."""
    name, mode = actuator.name, actuator.mode
    remedy = f"command its {mode.extent} instead of its {mode.effort}, or stiffen its walls"
    return (
        f"{type(actuator).__name__.lower()} {name!r} lost its stability between {last[name]:.6g} and "
        f"{commands[name]:.6g} {mode.unit}: its {mode.effort} falls with its {mode.extent} there; "
        f"remedy: {remedy if mode.conjugate else f'a smaller {mode.effort}, or a stiffer body'}"
    )


def past_limit(actuators: Sequence[Actuator], last: Mapping[str, float], commands: Mapping[str, float]) -> str:
    """Return a remedy for a jump: to command extents instead of the efforts that have changed; empty if none has."""
    found = [
        f"`command: {each.mode.extent}` for {each.name!r}"
        for each in actuators
        if each.mode.conjugate and commands.get(each.name) != last.get(each.name)
    ]
    return f"remedy: {', '.join(found)}, which holds shapes that a force or a pressure cannot" if found else ""


def handle_reactions(
    body: Body,
    positions: Array,
    force: Array,
    outside: Array | None = None,
    contacts: Sequence[Contact] = (),
    grips: Sequence[GripTerm] = (),
) -> dict[str, Array]:
    """Return the force and moment that each handle and each obstacle exerts on the body.

    Args:
        body: the discretised body.
        positions: (n, 3) [m].
        force: corner forces dE/dx (m, c, 3) [N] at these positions.
        outside: dE/dx (n, 3) [N] of the external terms; None if there are none.
        contacts: contact terms of the obstacles.
        grips: grips; their forces are added to the reactions of the holding handles and obstacles.

    Returns:
        Dict from handle or obstacle name to wrench (6,): force [N], then moment [N m]. The moment is about the mean of
        the handle's current vertices, or about the obstacle's origin.
    """
    reactions = {contact.name: contact.wrench(positions) for contact in contacts if contact.on_body}
    for handle in body.handles:
        if handle.name in reactions:
            continue
        vertices, axes = handle.bears or (handle.vertices, None)
        forces = vertex_forces(body, vertices, force)
        if outside is not None:
            forces += outside[vertices]
        if axes is not None:
            forces *= axes
        reactions[handle.name] = np.empty(6)
        _sum_wrench(positions, handle.vertices, vertices, forces, reactions[handle.name])
    for grip in (each for each in grips if each.presses):
        reactions[grip.actuator.holder] = reactions[grip.actuator.holder] + grip.wrench(positions)
    return reactions


def vertex_forces(body: Body, vertices: NDArray[np.int32], force: Array) -> Array:
    """Return the internal force dE/dx (k, 3) [N] at ``vertices`` (k,) from corner forces (m, c, 3) [N]."""
    total = np.empty((len(vertices), 3))
    _gather_forces(force, body.unknowns, vertices, total)
    return total


@kernel
def _gather_forces(force, unknowns, vertices, total):
    for i in range(len(vertices)):
        total[i, 0], total[i, 1], total[i, 2] = vertex_force(force, unknowns, vertices[i])


@kernel
def _sum_wrench(x, group, vertices, forces, wrench):
    """Write the sum of ``forces`` (k, 3) [N] on ``vertices`` (k,), and their moment [N m], to ``wrench``.

    The moment is about the mean position of the vertices in ``group``.
    """
    centre, force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for v in group:
        centre = plus(centre, scale_vector(corner(x, v), 1.0 / len(group)))
    for i in range(len(vertices)):
        f = corner(forces, i)
        force, moment = plus(force, f), plus(moment, cross(minus(corner(x, vertices[i]), centre), f))
    for axis in range(3):
        wrench[axis], wrench[3 + axis] = force[axis], moment[axis]
