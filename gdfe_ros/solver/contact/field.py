# SPDX-License-Identifier: Apache-2.0
"""The near points of all contacts of a body, in the layout of the kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.contact.contact_term import ContactTerm
from gdfe_ros.solver.contact.points import Surfaces
from gdfe_ros.solver.contact.stencil import Stencils


class PointField(NamedTuple):
    """The k near points of all t contacts.

    Attributes:
        stencils: their stencils; ends beyond a contact's own have no weight.
        surfaces: what they touch.
        owner: (k,) number of the contact of each point.
        friction, scale: (k,) friction coefficient, and stiffness [N/m] of the body at the point.
        rows, blocks, used: derivatives with respect to the rows of unknowns, see `differentiate`.
        ahead: (k, 3) [m] changes of gaps and slips in the step.
        usable, joins: (k,) whether a point may take part in the step, and whether it does.
        chosen: (k,) the points that take part, first.
        loads, acting: dead loads (n, 6) of all vertices, and whether any acts (1,): those of `HeldLoads`.
        change: (n, 3) [N] scratch, zero.
        before: (3 r,) [N] scratch.
        head: (1,) the history's next row when a pair was last changed.
    """

    stencils: Stencils
    surfaces: Surfaces
    owner: NDArray[np.int64]
    friction: NDArray[np.float64]
    scale: NDArray[np.float64]
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
    head: NDArray[np.int64]

    @classmethod
    def of(cls, contacts: Sequence[ContactTerm], surfaces: Surfaces, kept: Sequence[NDArray]) -> PointField:
        """Return the near points of ``contacts``, which touch ``surfaces``.

        The arrays from `loads` on are ``kept`` from field to field.
        """
        near = [contact if contact.near else None for contact in contacts]
        sizes = [contact.count if contact else 0 for contact in near]
        count, width = sum(sizes), max((contact.stencils.ends.shape[1] for contact in near if contact), default=1)
        stencils = Stencils.join([contact.stencils for contact in near if contact], width)
        multipliers = [contact.multipliers.reshape(-1, 4) for contact in near if contact]
        forces = np.concatenate([np.zeros((0, 4)), *multipliers])
        stencils.held[:, 0], stencils.shears[...] = forces[:, 0], forces[:, 1:]
        for number, contact in enumerate(contacts):
            surfaces.frames[number] = contact.shape.frames[0]
        return cls(
            stencils,
            surfaces,
            np.repeat(np.arange(len(contacts)), sizes),
            np.repeat([float(contact.friction) for contact in contacts], sizes),
            np.concatenate([np.zeros(0), *(contact.scale for contact in near if contact)]),
            np.zeros((count, 2 * width), np.int64),
            np.zeros((count, 2 * width, 3, 3)),
            np.zeros(count, np.int64),
            np.zeros((count, 3)),
            *np.zeros((2, count), np.bool_),
            np.zeros(count, np.int64),
            *kept,
        )
