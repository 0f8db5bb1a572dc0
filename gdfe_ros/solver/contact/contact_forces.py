# SPDX-License-Identifier: Apache-2.0
"""Contact forces of each quasi-Newton step: the step J d = p - p0 keeps the laws of contact, see `complementarity`.

A step without change of the forces is d = -H g. With the change df of the forces it is d = -H (g - J^T df), and the
gaps and slips at its end are p = p0 + J d. The forces f + df keep the laws between p and f.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.contact.answer import begin_step, look_again, settle
from gdfe_ros.solver.contact.complementarity import HALF, find_violations
from gdfe_ros.solver.contact.compliance import project, pull
from gdfe_ros.solver.contact.contact_term import FAINT, ROUNDING, ContactTerm, HeldLoads
from gdfe_ros.solver.contact.field import PointField
from gdfe_ros.solver.contact.kept_compliance import Compliance
from gdfe_ros.solver.contact.points import PLANES, Surfaces
from gdfe_ros.solver.descent.loop import MOST_FLAT, Metric
from gdfe_ros.solver.descent.workspace import Problem, Workspace, numbers
from gdfe_ros.solver.matrix.unknowns import Unknowns

Product = Callable[[NDArray[np.float64]], NDArray[np.float64]]

ROUNDS = 8
"""Largest number of such rounds in one step; what is left enters the next step."""
EXACT = 1e-6
"""Allowed violation of the laws, divided by the length of the last step, or by the target of the minimisation."""
ROUGH = 1e-5
"""The laws are solved again if their violation, divided by the length of the step that they give, exceeds this."""
MOST_CHANGES = 30
"""Number of iterations in which surfaces touch other faces, while no step is half as long as the shortest one before,
or in which the laws are violated, and by no less than half of the least violation before: with more, contact does not
settle.
"""
NEARLY, SLIGHT = 5e-2, 5e-10
"""Violation of the laws that counts as nothing if less is out of reach, as where forces of redundant points are not
unique: divided by the target of the minimisation, and by the body's size.
"""
REVERSED, MOST_INERTIA, FADING = 0.7, 64.0, 0.7
"""A step reverses the last one if the cosine between both is below minus the first number. Forces and steps then get an
inertia of at least 1 and at most the second number, which fades by the last one in each step that does not reverse the
last one. It is the compliance against a change of a force, divided by that of the body at the point, and the fraction
1 / (1 + inertia) of each step is made. Without it, the notched finger of a test closes 0.7 mm beside its plane.
"""
LISTED = 5
"""Number of vertices that a message names."""


class ContactForces:
    """Finds the contact forces of each step of a minimisation.

    Args:
        contacts: all contact terms of the body.
        held: the term that stands for their forces.
        unknowns: numbering of the unknowns.
        count: number n of vertices.

    Attributes:
        contacts: the argument.
        left: largest violation [m] of the laws in the last step.
    """

    def __init__(self, contacts: Sequence[ContactTerm], held: HeldLoads, unknowns: Unknowns, count: int) -> None:
        self.contacts, self._held = tuple(contacts), held
        self._searches = [contact for contact in contacts if contact.shape.kind[0] == PLANES]
        self._handle_of = np.full(count, -1, dtype=np.int64)
        for p in range(len(unknowns.slides)):
            self._handle_of[unknowns.members[unknowns.member_start[p] : unknowns.member_start[p + 1]]] = p
        self._rows, self._swings = 3 * unknowns.rows, any(contact.valid < np.inf for contact in contacts)
        self._turns = unknowns.rigid_rows > 0
        self._surfaces = Surfaces.join([contact.shape for contact in contacts])
        self._change, self._head = np.zeros((count, 3)), np.zeros(1, dtype=np.int64)
        self.begin()
        self._row_of, self._numbered = np.full(count, -1, dtype=np.int64), None
        vertices = np.unique(np.concatenate([contact.vertices for contact in contacts]))
        self._compliance = Compliance(vertices, self._rows)

    def begin(self) -> None:
        """Prepare a solve."""
        self.left, self._nearest, self._changes, self._idle = 0.0, np.inf, 0, 0.0
        self._least, self._in_vain, self._faint = np.inf, 0, 0.0
        self._last, self._inertia, self._head[0] = np.zeros(self._rows), 0.0, 0
        self._field: PointField | None = None

    @property
    def near(self) -> bool:
        """Whether any point is near an obstacle."""
        return any(contact.near for contact in self.contacts)

    def told(self) -> str:
        """Return the contacts in the last step, the vertices where the laws are violated most, and by how much."""
        names = ", ".join(contact.name for contact in self.contacts if contact.near)
        where = ", ".join(map(str, self._worst_vertices()))
        return f"{names}: {self.left:.3g} m of gap or slip remain, most at vertices {where}"

    def _worst_vertices(self) -> NDArray[np.int64]:
        """Return up to `LISTED` vertices, ascending, where the laws are violated by more than half of the most."""
        field, chosen, w, q, forces = self._unsolved
        found, vertices = np.empty(len(chosen)), field.stencils.ends[chosen, 0]
        find_violations(w, q, field.friction[chosen], forces, found)
        order = np.argsort(-found, kind="stable")[:LISTED]
        return np.unique(vertices[order[found[order] > 0.5 * found.max(initial=0.0)]])

    def begin_step(self, problem: Problem, work: Workspace, metric: Metric, size: float, most: int) -> int:
        """Turn the forces with the surfaces, and find the step with them; return the result of `choose`.

        The points of contacts that have moved far are chosen again. ``problem``, ``work`` and ``metric`` are those of
        the minimisation; ``size`` [m] is the body's size, and ``most`` the number of iterations that a matrix serves.
        """
        if self._searches:
            self.return_forces()
        self._waiting = [contact for contact in self._searches if not contact.acts]
        for contact in self.contacts:
            if contact not in self._waiting and contact.strays(work.x):
                self._follow(contact, work.x, np.inf)
        given = self._row_of, self._handle_of, size, most
        if self._field is not None:
            self._correct(self._field, work)
        found, self._count = begin_step(problem, work, metric, self._gather(problem, work), *given)
        return found

    def _follow(self, contact: ContactTerm, positions: NDArray[np.float64], ahead: float) -> None:
        """Let a contact choose its points again; the next step moves vertices by at most ``ahead`` [m]."""
        self.return_forces()
        was_near = contact.near
        contact.follow(positions, ahead)
        if was_near or contact.near:
            self._field = None

    def return_forces(self) -> None:
        """Give the present forces back to the contacts."""
        if self._field is None:
            return
        for contact, part in zip(self.contacts, self._parts, strict=True):
            if part.stop > part.start:
                contact.take_forces(self._field.stencils.held[part, 0], self._field.stencils.shears[part])

    def approach(self, work: Workspace) -> bool:
        """Choose the points again of the other contacts, before the step in ``work``; return whether any is near."""
        # The rows of turning handles are no displacements of vertices.
        ahead = np.inf if self._turns else float(numbers(work)["step"])
        for contact in self._waiting:
            self._follow(contact, work.x, ahead)
        return self.near

    @property
    def settled(self) -> bool:
        """Whether the places that touch, and the forces on them, have settled or may still do so."""
        return max(self._changes, self._in_vain) <= MOST_CHANGES and self._idle <= MOST_FLAT

    def settles(self, work: Workspace, trust: float) -> bool:
        """Update the counts of `settled` after an iteration, and return `settled`.

        The first count is of iterations in which points touched other faces than before, the second of iterations in
        which no forces kept the laws of contact. The third is of iterations in which no step was half as long as the
        shortest one before; it counts ``trust``, the part of the distance to the equilibrium that a step covers.
        """
        nearest, step = float(numbers(work)["nearest"]), float(numbers(work)["step"])
        if self.left <= max(HALF * self._least, ROUGH * step, self._faint):
            self._least, self._in_vain = self.left, 0
        self._in_vain += self.left > max(ROUGH * step, self._faint)
        if nearest != self._nearest:
            self._nearest, self._changes, self._idle = nearest, 0, 0.0
        self._idle += trust
        self._changes += any(contact.changed for contact in self.contacts)
        return self.settled

    def answer(
        self, problem: Problem, work: Workspace, metric: Metric, key: tuple[object, ...], size: float, target: float
    ) -> int:
        """Find the forces with which the step keeps the laws, and write that step; return the result of `choose`.

        ``problem``, ``work`` and ``metric`` are those of the minimisation; the step without new forces is in
        ``work.direction``. ``key`` is the identity of the initial matrix, ``size`` [m] the body's size, and ``target``
        [m] the distance to the equilibrium that the minimisation allows.
        """
        afresh, status, found, before = self._field is None, numbers(work), 2, np.inf
        field, count = self._gather(problem, work), self._count
        if afresh:
            count = look_again(problem, work, field, self._row_of, self._handle_of, size)
        self.left, allowed = 0.0, EXACT * max(target, min(float(status["before"]), float(status["step"])))
        self._faint = faint = max((FAINT if self._swings else SLIGHT) * size, NEARLY * target)
        known: tuple[int, int] | None = None
        for _ in range(ROUNDS):
            if count and known != (count, int(status["wild"])):
                w = self._compliance.of(problem, work, metric, key, field, count)
                known = count, int(status["wild"])
                if self._swings:
                    w[np.diag_indices(len(w))] += np.repeat(self._inertia / field.scale[field.chosen[:count]], 3)
            given = field, count, w if count else np.zeros((0, 0)), size, target, allowed, faint
            self.left, chose, changed, entered, *solved = settle(problem, work, metric, *given)
            self._unsolved = field, field.chosen[:count].copy(), w if count else np.zeros((0, 0)), *solved
            if not changed:
                break
            found, rough = chose, self.left > max(faint, ROUGH * max(target, float(status["step"])))
            if not ((rough and self.left < HALF * before) or entered):
                break
            before, allowed = self.left, EXACT * max(target, float(status["step"]))
            if entered:
                count += entered
                field.chosen[:count] = np.flatnonzero(field.joins)
        self._shorten(work, field)
        return found

    def _shorten(self, work: Workspace, field: PointField) -> None:
        """Shorten the step if it swings, or if points move farther past what they touch than their stencils hold.

        The distance to the equilibrium is still measured by the whole step.
        """
        if not self._swings:
            return
        self._watch(work.direction)
        share = 1.0 / (1.0 + self._inertia)
        for contact, part in zip(self.contacts, self._parts, strict=True):
            longest = float(np.sqrt(np.square(field.ahead[part]).sum(axis=1).max(initial=0.0)))
            share = min(share, contact.valid / max(longest, 1e-300))
        if share < 1.0:
            work.direction[...] *= share
            numbers(work)["slope"] *= share

    def _watch(self, step: NDArray[np.float64]) -> None:
        """Double the inertia if a ``step`` (3 r,) [m] reverses the last one; otherwise it fades.

        Faces that touch are found anew before each step. Forces may then change from one side to the other and back,
        and turn back and forth with their normals.
        """
        reverses = self._last @ step < -REVERSED * np.sqrt((self._last @ self._last) * (step @ step))
        self._inertia = min(max(1.0, 2.0 * self._inertia), MOST_INERTIA) if reverses else FADING * self._inertia
        self._last = step.copy()

    def supported(self, problem: Problem, work: Workspace, product: Product) -> Product:
        """Return ``product``, the product with the body's tangent, plus springs where points press or stick.

        The body is stable if its tangent is positive definite for the motions that the contacts leave. Springs as stiff
        as the body stand for the other motions.
        """
        if not self.near:
            return product
        field = self._gather(problem, work)
        look_again(problem, work, field, self._row_of, self._handle_of, 0.0)
        held, given = field.stencils.held, (field.rows, field.blocks, field.used)
        press, shear = held[:, 0], np.linalg.norm(held[:, 1:], axis=1)
        sticks = (press > 0.0) & (shear < (1.0 - ROUNDING) * field.friction * press)
        springs = field.scale[:, None] * np.column_stack([press > 0.0, sticks, sticks])

        def multiply(direction: NDArray[np.float64]) -> NDArray[np.float64]:
            image, way = product(direction), np.empty_like(held)
            project(direction, *given, way)
            pull(springs * way, *given, image)
            return image

        return multiply

    def _gather(self, problem: Problem, work: Workspace) -> PointField:
        """Return the near points of all contacts; they are gathered again after any contact has chosen others."""
        unknowns = problem.unknowns
        if self._numbered is not unknowns:
            self._row_of[...] = -1
            self._row_of[unknowns.free] = np.arange(len(unknowns.free))
            self._numbered = unknowns
        if self._field is None:
            kept = self._held.loads, self._held.integers, self._change, np.empty(self._rows), self._head
            self._field = PointField.of(self.contacts, self._surfaces, kept)
            ends = np.searchsorted(self._field.owner, np.arange(len(self.contacts) + 1))
            self._parts = [slice(*each) for each in pairwise(ends)]
            self._correct(self._field, work)
        return self._field

    def _correct(self, field: PointField, work: Workspace) -> None:
        """Update the offsets of gaps that depend on the positions."""
        for contact, part in zip(self.contacts, self._parts, strict=True):
            if part.stop > part.start and contact.corrects:
                field.stencils.offsets[part] = contact.correct(work.x)
