# SPDX-License-Identifier: Apache-2.0
"""The minimisation with contact: choice of near points, and work between two calls of the compiled loop in `answer`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import allocate_record
from gdfe_ros.solver.contact.answer import (
    ANSWER,
    BEGIN,
    MOVE,
    SEARCH,
    START,
    TALLY,
    descend_touching,
    is_settling,
    look_again,
)
from gdfe_ros.solver.contact.complementarity import find_violations
from gdfe_ros.solver.contact.compliance import Compliance
from gdfe_ros.solver.contact.contact_term import FAINT, SLIP_MARGIN
from gdfe_ros.solver.contact.field import HeldLoads, PointField, project, pull
from gdfe_ros.solver.contact.stencil import PLANES
from gdfe_ros.solver.descent.lbfgs_workspace import Problem, Workspace
from gdfe_ros.solver.descent.loop import Metric
from gdfe_ros.solver.matrix.unknowns import Unknowns, place

Product = Callable[[NDArray[np.float64]], NDArray[np.float64]]

NEARLY, SLIGHT = 5e-2, 5e-10
"""A violation of the laws is negligible if it is at most the first number times the target of the minimisation, or at
most the second number times the body's size (with self-contact, `FAINT` times its size). It is accepted if no smaller
violation can be reached, for example, because forces of redundant points are not unique.
"""
LISTED = 5
"""Number of vertices that a message names."""


class ContactForces:
    """Finds the contact forces of each step of a minimisation.

    Args:
        held: the near points of all contacts, and the dead loads that represent the contact forces.
        unknowns: numbering of the unknowns.
        count: number n of vertices.

    Attributes:
        contacts: all contact terms of the body.
    """

    def __init__(self, held: HeldLoads, unknowns: Unknowns, count: int) -> None:
        self.contacts, self._held = held.contacts, held
        self._searches = [contact for contact in self.contacts if contact.shape.kind[0] == PLANES]
        handle_of = np.full(count, -1, dtype=np.int64)
        for p in range(len(unknowns.slides)):
            handle_of[unknowns.members[unknowns.member_start[p] : unknowns.member_start[p + 1]]] = p
        self._rows, self._numbered = (np.full(count, -1, dtype=np.int64), handle_of), None
        self._record = allocate_record(TALLY)
        self._tally = self._record[0]
        self._tally["swings"] = any(contact.valid < np.inf for contact in self.contacts)
        self.begin()
        vertices = np.unique(np.concatenate([contact.vertices for contact in self.contacts]))
        self._compliance = Compliance(vertices, 3 * unknowns.rows)

    def begin(self) -> None:
        """Prepare a solve."""
        self._tally["least"] = self._tally["nearest"] = np.inf
        for name in ("in_vain", "changes", "idle", "left", "allowed", "faint", "inertia"):
            self._tally[name] = 0
        self._held.last[...], self._held.head[0] = 0.0, 0

    @property
    def left(self) -> float:
        """Largest violation [m] of the laws in the last step."""
        return float(self._tally["left"])

    @property
    def accepted(self) -> float:
        """Violation [m] up to which the laws counted as satisfied in the last step."""
        return max(float(self._tally["allowed"]), float(self._tally["faint"]))

    @property
    def near(self) -> bool:
        """Whether any point is near an obstacle."""
        return any(contact.near for contact in self.contacts)

    def tell_worst(self) -> str:
        """Return a text with the contacts in the last step, the largest violation of the laws, and its vertices."""
        names = ", ".join(contact.name for contact in self.contacts if contact.near)
        where = ", ".join(map(str, self._worst_vertices()))
        return f"{names}: {self.left:.3g} m of gap or slip remain, most at vertices {where}"

    def _worst_vertices(self) -> NDArray[np.int64]:
        """Return up to `LISTED` vertices, ascending, whose violation of the laws exceeds half of the largest one."""
        field, known = self._unsolved, self._compliance.known
        chosen = field.chosen[: len(known.w) // 3]
        found, vertices = np.empty(len(chosen)), field.stencils.ends[chosen, 0]
        find_violations(known.w, known.q, field.friction[chosen], known.forces, found)
        order = np.argsort(-found, kind="stable")[:LISTED]
        return np.unique(vertices[order[found[order] > 0.5 * found.max(initial=0.0)]])

    def descend(
        self,
        problem: Problem,
        work: Workspace,
        metric: Metric,
        key: tuple[object, ...],
        minimum: tuple[float, float, bool, int],
        limit: int,
        show: Callable[[], None] | None,
        *,
        begins: bool,
    ) -> int:
        """Do `loop.descend` with contact; return the number of iterations.

        ``problem``, ``work``, ``metric``, ``limit`` and ``begins`` are arguments of `loop.descend`. ``minimum`` has
        four more of them: size, target, proven and most. ``key`` identifies the initial matrix. ``show``, unless None,
        is called in each step, after its forces have been found.
        """
        tally, made, (size, target, _, _) = self._tally, 0, minimum
        tally["stage"] = START if begins else BEGIN
        tally["over"], tally["shows"], tally["room"] = 0, show is not None, -np.inf
        tally["faint"] = max((FAINT if tally["swings"] else SLIGHT) * size, NEARLY * target)
        self._number_rows(problem)
        if begins and len(problem.unknowns.slides):  # handles that are free have moved
            place(work.u, problem.frame, problem.unknowns, work.x)
        field = known = None
        while (made < limit or tally["stage"] == START) and not tally["over"]:
            field = self._attend(problem, work, field, size, show)
            if known is None or tally["stage"] == ANSWER:
                count = int(tally["count"]) if tally["stage"] == ANSWER else -1
                known, self._unsolved = self._compliance.prepare(problem, work, metric, key, field, count), field
            given = problem, work, metric, field, known, self._record, self._rows, *minimum
            made += descend_touching(*given, limit - made)
        return made

    def _attend(
        self, problem: Problem, work: Workspace, field: PointField | None, size: float, show: Callable[[], None] | None
    ) -> PointField:
        """Choose or search points, or show the step, as the next stage requires; return the near points."""
        tally = self._tally
        if tally["stage"] in (START, BEGIN):
            self._choose_points(work)
            field = self._held.gather()
        elif tally["stage"] == SEARCH:
            tally["stage"] = ANSWER
            if self._approach(work):
                field = self._held.gather()
                tally["count"] = look_again(problem, work, field, self._rows, size)
        elif tally["stage"] == MOVE:
            show()
        tally["changed"] = any(contact.changed for contact in self.contacts)
        return field

    def _choose_points(self, work: Workspace) -> None:
        """Choose points again for contacts whose points have moved far; store the motion after which this is due."""
        self._waiting = [contact for contact in self._searches if not contact.acts]
        room = spare = np.inf
        for contact in self.contacts:
            own = contact.room(work.x)
            if contact in self._waiting:
                spare = min(spare, own)
                continue
            if not own > 0.0:
                contact.follow(work.x, np.inf)
                own = 0.0 if contact in self._searches else contact.room(work.x)
            room = min(room, own)
        self._tally["gone"], self._tally["room"], self._tally["spare"] = 0.0, room, spare

    def _approach(self, work: Workspace) -> bool:
        """Search pairs before the step in ``work`` for self-contact without forces; return whether any are near."""
        self._tally["room"], near = -np.inf, False  # points are chosen again before the next step
        for contact in self._waiting:
            near |= contact.near
            contact.follow(work.x, 2.0 * float(work.status[0]["step"]))
            near |= contact.near
        return near

    @property
    def settled(self) -> bool:
        """Whether the touching points and their forces have settled, or may still settle."""
        return is_settling(self._record)

    def support(self, problem: Problem, work: Workspace, product: Product) -> Product:
        """Return ``product``, the product with the body's tangent, plus that of springs at points that press.

        The body is stable if its tangent is positive definite for all motions that the contacts allow. The springs, as
        stiff as the body, resist the other motions: along normals, and along the surface at points that stick.
        """
        if not self.near:
            return product
        self._number_rows(problem)
        field = self._held.gather()
        look_again(problem, work, field, self._rows, 0.0)
        held, given = field.stencils.held, (field.rows, field.blocks, field.used)
        press, shear = held[:, 0], np.linalg.norm(held[:, 1:], axis=1)
        sticks = (press > 0.0) & (shear < (1.0 - SLIP_MARGIN) * field.friction * press)
        springs = field.stencils.scale[:, None] * np.column_stack([press > 0.0, sticks, sticks])

        def multiply(direction: NDArray[np.float64]) -> NDArray[np.float64]:
            image, way = product(direction), np.empty_like(held)
            project(direction, *given, way)
            pull(springs * way, *given, image)
            return image

        return multiply

    def _number_rows(self, problem: Problem) -> None:
        """Find the row of each free vertex."""
        if self._numbered is not problem.unknowns:
            self._rows[0][...] = -1
            self._rows[0][problem.unknowns.free] = np.arange(len(problem.unknowns.free))
            self._numbered = problem.unknowns
