# SPDX-License-Identifier: Apache-2.0
"""Reactions of handles and obstacles on the body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.materials.tensor import scaled
from gdfe_ros.mesh.triples import corner, cross, minus, plus
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact import Contact
from gdfe_ros.solver.forces.grip import GripTerm
from gdfe_ros.solver.matrix.unknowns import vertex_force


def handle_reactions(
    body: Body,
    positions: NDArray[np.float64],
    force: NDArray[np.float64],
    outside: NDArray[np.float64] | None = None,
    contacts: Sequence[Contact] = (),
    grips: Sequence[GripTerm] = (),
) -> dict[str, NDArray[np.float64]]:
    """Return the force and moment that each handle and each obstacle exerts on the body.

    Args:
        body: the discretised body.
        positions: (n, 3) [m].
        force: corner forces dE/dx (m, c, 3) [N] at these positions.
        outside: dE/dx (n, 3) [N] of the external terms; None if there are none.
        contacts: contact terms of the obstacles.
        grips: grips, whose forces are added to those of the handles and obstacles that hold.

    Returns:
        Dict from handle or obstacle name to wrench (6,): force [N], then moment [N m]. The moment is about the mean of
        the handle's current vertices, or about the obstacle's origin.
    """
    reactions = {contact.name: contact.wrench(positions) for contact in contacts if contact.on_body}
    for handle in body.handles:
        if handle.name in reactions:
            continue
        forces = vertex_forces(body, handle.vertices, force)
        if outside is not None:
            forces += outside[handle.vertices]
        reactions[handle.name] = np.empty(6)
        _sum_wrench(positions, handle.vertices, forces, reactions[handle.name])
    for grip in (each for each in grips if each.presses):
        reactions[grip.actuator.holder] = reactions[grip.actuator.holder] + grip.wrench(positions)
    return reactions


def vertex_forces(body: Body, vertices: NDArray[np.int32], force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the internal force dE/dx (k, 3) [N] at ``vertices`` (k,) from corner forces (m, c, 3) [N]."""
    total = np.empty((len(vertices), 3))
    _gather_forces(force, body.unknowns, vertices, total)
    return total


@kernel
def _gather_forces(force, unknowns, vertices, total):
    for i in range(len(vertices)):
        total[i, 0], total[i, 1], total[i, 2] = vertex_force(force, unknowns, vertices[i])


@kernel
def _sum_wrench(x, vertices, forces, wrench):
    """Write the sum of ``forces`` (k, 3) [N] and their moment [N m] about the vertices' mean position to ``wrench``."""
    centre, force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for v in vertices:
        centre = plus(centre, scaled(corner(x, v), 1.0 / len(vertices)))
    for i in range(len(vertices)):
        f = corner(forces, i)
        force, moment = plus(force, f), plus(moment, cross(minus(corner(x, vertices[i]), centre), f))
    for axis in range(3):
        wrench[axis], wrench[3 + axis] = force[axis], moment[axis]
