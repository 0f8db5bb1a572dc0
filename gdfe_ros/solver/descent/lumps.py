# SPDX-License-Identifier: Apache-2.0
"""Hard inclusions in a soft body, and their remaining rotation, which the preconditioned step does not show.

The constant matrix resists a rotation of an inclusion as if the rotation strained hard material. At a stiffness ratio
of 1e6 the preconditioned step becomes tiny long before the inclusion has rotated. At that point the body can still
release several per cent of its energy. The remaining rotation is the moment on the inclusion, divided by the rotational
stiffness of its soft surroundings.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import assemble

CONTRAST = 30.0
"""An element counts as hard if its stiffness exceeds the least stiffness in the body by this factor."""


class Lump(NamedTuple):
    """A connected inclusion of hard elements without a vertex of a handle.

    Attributes:
        vertices: (k,) int32.
        stiffness: rotational stiffness [N m / rad] of its soft surroundings.
        radius: largest undeformed distance of its vertices from their mean [m].
    """

    vertices: NDArray[np.int32]
    stiffness: float
    radius: float


def find_lumps(body: Body, weight: NDArray[np.float64], bending: NDArray[np.float64]) -> tuple[Lump, ...]:
    """Return the hard inclusions; the constant matrix has the weights ``weight`` (m,) [Pa], ``bending`` (m,) [N/m]."""
    hard = weight > CONTRAST * weight.min()
    if not hard.any() or hard.all():
        return ()
    cells = body.cells[hard]
    others = cells.shape[1] - 1
    links = coo_array((np.ones(others * len(cells)), (np.repeat(cells[:, 0], others), cells[:, 1:].ravel())))
    links.resize((len(body.rest), len(body.rest)))
    piece = connected_components(links, directed=False)[1]
    held = np.unique(piece[body.unknowns.prescribed])
    soft = assemble(body.shape, np.where(hard, 0.0, weight), np.where(hard, 0.0, bending))
    lumps = []
    for label in np.setdiff1d(np.unique(piece[cells]), held):
        vertices = np.flatnonzero(piece == label).astype(np.int32)
        arms = body.rest[vertices] - body.rest[vertices].mean(axis=0)
        turns = np.zeros((len(body.rest), 3))
        turns[vertices] = arms
        stiffness = 2.0 / 3.0 * float(np.vdot(turns, soft @ turns))
        lumps.append(Lump(vertices, stiffness, float(np.linalg.norm(arms, axis=1).max())))
    return tuple(lumps)


def largest_turn(lumps: tuple[Lump, ...], x: NDArray[np.float64], gradient: NDArray[np.float64]) -> float:
    """Return the largest displacement [m] that the remaining rotation of an inclusion causes at its vertices.

    The rotation is the unbalanced moment on the inclusion, divided by the inclusion's `Lump.stiffness`.

    Args:
        lumps: the inclusions of the body.
        x: (n, 3) positions [m].
        gradient: (n, 3) dE/dx of every vertex [N].
    """
    most = 0.0
    for lump in lumps:
        arms = x[lump.vertices] - x[lump.vertices].mean(axis=0)
        moment = np.cross(arms, gradient[lump.vertices]).sum(axis=0)
        most = max(most, lump.radius * float(np.linalg.norm(moment)) / lump.stiffness)
    return most
