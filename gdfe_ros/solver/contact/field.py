# SPDX-License-Identifier: Apache-2.0
"""The near points of all contacts of a body in one set of arrays, their derivatives, and their forces as dead loads."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from operator import is_
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact_term import ContactTerm
from gdfe_ros.solver.contact.stencil import (
    LOADS,
    NOTHING_NEAR,
    GapFaces,
    Stencils,
    Surfaces,
    add_loads,
    find_stencils,
    held_entry,
)
from gdfe_ros.solver.contact.touch import Touches
from gdfe_ros.solver.matrix.rotation import left_jacobian_transposed
from gdfe_ros.solver.matrix.unknowns import rigid_part
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import Term


class PointField(NamedTuple):
    """The k near points of all t contacts.

    Attributes:
        stencils: stencils of the points, with the same number of ends for all contacts; unused ends have no weight.
        surfaces, faces: the touched surfaces, and the faces that correct the points' gaps.
        owner: (k,) number of the contact of each point.
        friction, restitution, valid: (k,) attributes of each point's `ContactTerm`.
        rows, blocks, used: derivatives with respect to the rows of unknowns, see `differentiate`.
        ahead: (k, 3) [m] changes of gaps and slips in the step.
        usable, joins: (k,) whether a point may take part in the step, and whether it takes part.
        chosen: (k,) indices; the first ones are of the points that take part in the step.
        loads, acting: dead loads (n, 6) of all vertices, and whether any acts (1,); the data of the term `HeldLoads`.
        change: (n, 3) [N] scratch, zero.
        before, last: (3 r,) gradient before the forces turn [N], and the last step [m].
        head: (1,) index of the next row of the L-BFGS history when a pair was last corrected for turned forces.
    """

    stencils: Stencils
    surfaces: Surfaces
    faces: GapFaces
    owner: NDArray[np.int64]
    friction: NDArray[np.float64]
    restitution: NDArray[np.float64]
    valid: NDArray[np.float64]
    rows: NDArray[np.int64]
    blocks: NDArray[np.float64]
    used: NDArray[np.int64]
    ahead: NDArray[np.float64]
    usable: NDArray[np.bool_]
    joins: NDArray[np.bool_]
    chosen: NDArray[np.int64]
    loads: NDArray[np.float64]
    acting: NDArray[np.int32]
    change: NDArray[np.float64]
    before: NDArray[np.float64]
    last: NDArray[np.float64]
    head: NDArray[np.int64]


@kernel
def differentiate(x, u, frame, unknowns, row_of, handle_of, axes, ends, pressing, rubbing, rows, blocks, counts):
    """Write the derivative of each point's gap and slip with respect to the rows of unknowns.

    ``row_of`` (n,) is the row of each free vertex, and ``handle_of`` (n,) the number of each vertex' handle with a free
    axis; both are -1 for other vertices. ``axes``, ``ends``, ``pressing`` and ``rubbing`` are arrays of `Stencils`. The
    results are the ``rows`` (k, e) on which each point depends, their number ``counts`` (k,), and the derivatives
    ``blocks`` (k, e, 3, 3).
    """
    count = len(unknowns.free)
    for i in range(len(ends)):
        counts[i] = 0
        for a in range(ends.shape[1]):
            v = ends[i, a]
            row = row_of[v]
            if row >= 0:
                e = entry_of(row, i, rows, blocks, counts)
                for k in range(3):
                    w = pressing[i, a] if k == 0 else rubbing[i, a]
                    for j in range(3):
                        blocks[i, e, k, j] += w * axes[i, k, j]
            elif handle_of[v] >= 0:
                p = handle_of[v]
                e = entry_of(count + p, i, rows, blocks, counts)
                for k in range(3):
                    w = pressing[i, a] if k == 0 else rubbing[i, a]
                    for j in range(3):
                        blocks[i, e, k, j] += w * axes[i, k, j] * unknowns.slides[p, j]
                if unknowns.turn_row[p] < 0:
                    continue
                e = entry_of(unknowns.turn_row[p], i, rows, blocks, counts)
                shift = rigid_part(u, count + p, unknowns.slides, p, 1.0)
                turn = rigid_part(u, unknowns.turn_row[p], unknowns.turns, p, 1.0 / unknowns.radius[p])
                r0 = x[v, 0] - frame.centre[p, 0] - shift[0]
                r1 = x[v, 1] - frame.centre[p, 1] - shift[1]
                r2 = x[v, 2] - frame.centre[p, 2] - shift[2]
                for k in range(3):
                    w = pressing[i, a] if k == 0 else rubbing[i, a]
                    d0, d1, d2 = w * axes[i, k, 0], w * axes[i, k, 1], w * axes[i, k, 2]
                    moment = r1 * d2 - r2 * d1, r2 * d0 - r0 * d2, r0 * d1 - r1 * d0
                    moment = left_jacobian_transposed(turn, moment)
                    for j in range(3):
                        blocks[i, e, k, j] += moment[j] * unknowns.turns[p, j] / unknowns.radius[p]


@internal
def entry_of(row, i, rows, blocks, counts):
    """Return the index of ``row`` among the rows of point ``i``; append the row if it is new."""
    for e in range(counts[i]):
        if rows[i, e] == row:
            return e
    e = counts[i]
    rows[i, e] = row
    blocks[i, e] = 0.0
    counts[i] += 1
    return e


@kernel
def project(direction, rows, blocks, counts, out):
    """Write J d (k, 3) [m], the change of gap and slip of each point in a step ``direction`` (3 r,)."""
    for i in range(len(rows)):
        for k in range(3):
            total = 0.0
            for e in range(counts[i]):
                for j in range(3):
                    total += blocks[i, e, k, j] * direction[3 * rows[i, e] + j]
            out[i, k] = total


@kernel
def pull(forces, rows, blocks, counts, out):
    """Add J^T f (3 r,) [N] to ``out``, for forces f (k, 3) [N] along the axes of each point."""
    for i in range(len(rows)):
        for e in range(counts[i]):
            for j in range(3):
                for k in range(3):
                    out[3 * rows[i, e] + j] += blocks[i, e, k, j] * forces[i, k]


class HeldLoads(Term):
    """The near points of all contacts, and the dead loads that replace the contact forces during a minimisation's step.

    Args:
        body: the discretised body.
        contacts: all contact terms of the body.

    Attributes:
        contacts: the argument.
        field: the near points of all contacts; the stencils of each contact are views of it.
        parts: the first and the last number plus 1 of the points of each contact in the field.
        last, head: see `PointField`.
    """

    kernel = held_entry

    def __init__(self, body: Body, contacts: Sequence[ContactTerm]) -> None:
        count = len(body.rest)
        super().__init__("(contacts)", np.zeros(LOADS * count), np.zeros(1, np.int32))
        self.contacts, self.head = tuple(contacts), np.zeros(1, dtype=np.int64)
        before, self.last = np.zeros((2, 3 * body.unknowns.rows))
        self._scratch = np.zeros((count, 3)), before
        self._numbers = np.array([[each.friction, each.restitution, each.valid] for each in contacts]).reshape(-1, 3)
        self.field: PointField | None = None
        self._gathered: tuple[object, ...] = ()
        self.parts: list[tuple[int, int]] = []
        if contacts:
            self._surfaces = Surfaces.join([contact.shape for contact in contacts])
            for number, contact in enumerate(contacts):
                contact.shape = contact.shape._replace(frames=self._surfaces.frames[number : number + 1])

    def gather(self) -> PointField:
        """Return the field; it is made anew if a contact has more or fewer points, or other faces, than before."""
        near = [(each.stencils, each.faces) if each.near else NOTHING_NEAR for each in self.contacts]
        stencils, faces = zip(*near, strict=True)
        if self.field is not None and all(map(is_, self._gathered, stencils + faces)):
            return self.field
        sizes, width = [len(each.fixed) for each in stencils], max(each.ends.shape[1] for each in stencils)
        count, owner = sum(sizes), np.repeat(np.arange(len(sizes)), sizes)
        self.field = PointField(
            Stencils.join(stencils, width),
            self._surfaces,
            GapFaces.join(faces),
            owner,
            *np.ascontiguousarray(self._numbers[owner].T),
            np.zeros((count, 2 * width), np.int64),
            np.zeros((count, 2 * width, 3, 3)),
            np.zeros(count, np.int64),
            np.zeros((count, 3)),
            *np.zeros((2, count), np.bool_),
            np.zeros(count, np.int64),
            self.reals.reshape(-1, LOADS),
            self.integers,
            *self._scratch,
            self.last,
            self.head,
        )
        self.parts, views = list(pairwise(np.cumsum([0, *sizes]).tolist())), []
        for contact, (first, last) in zip(self.contacts, self.parts, strict=True):
            if contact.near:
                contact.stencils = self.field.stencils.part(first, last)
            views.append(contact.stencils if contact.near else NOTHING_NEAR[0])
        self._gathered = *views, *faces
        return self.field

    def look(self, positions: NDArray[np.float64]) -> PointField:
        """Update the field to ``positions`` (n, 3) [m], where the forces turn with the surfaces; return the field."""
        field = self.gather()
        if len(field.owner):
            find_stencils(positions, field.surfaces, field.faces, field.owner, field.stencils)
        return field

    def set_loads(self, positions: NDArray[np.float64]) -> None:
        """Set the dead loads to the forces of all contacts, with zero energy at ``positions`` (n, 3) [m]."""
        field = self.look(positions)
        self.integers[0] = field.stencils.held.any()
        field.loads[:, :3], field.loads[:, 3:] = 0.0, positions
        if self.integers[0]:
            add_loads(field.stencils, field.loads)


def find_touches(contacts: Sequence[ContactTerm], state: State, origin: NDArray[np.float64]) -> Touches:
    """Return all contacts and forces stored in ``state``; its positions are relative to ``origin`` (3,) [m]."""
    given = state.positions, state.poses, origin
    return Touches({contact.name: partial(contact.touch, state.terms[contact.name], *given) for contact in contacts})
