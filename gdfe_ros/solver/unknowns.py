# SPDX-License-Identifier: Apache-2.0
"""Which positions are unknown: free vertices, and one shared translation for each free axis of a plate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.constraints import Handle


class Unknowns(NamedTuple):
    """Rows of unknowns (r, 3): first the free vertices, then the plates that have a free axis.

    Attributes:
        free: (f,) int32 vertex of each of the first f rows.
        prescribed: (b,) int32 vertices of all plates, plate by plate.
        plate_start: (p + 1,) int32, where the vertices of each sliding plate start in ``plate_vertices``.
        plate_vertices: int32 vertices of the sliding plates.
        plate_axes: (p, 3) float64, 1 for a free axis, 0 for a prescribed one.
        corner_start: (n + 1,) int32, where each vertex's list of element corners starts in ``corner``.
        corner: (8 m,) int32, element times eight plus corner; each vertex sums its forces in this order.
    """

    free: NDArray[np.int32]
    prescribed: NDArray[np.int32]
    plate_start: NDArray[np.int32]
    plate_vertices: NDArray[np.int32]
    plate_axes: NDArray[np.float64]
    corner_start: NDArray[np.int32]
    corner: NDArray[np.int32]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.free) + len(self.plate_axes)


def number_unknowns(n_vertices: int, cells: NDArray[np.int32], handles: Sequence[Handle]) -> Unknowns:
    """Number the unknowns of a mesh of ``n_vertices`` with ``cells`` (m, 8) held by ``handles``."""
    prescribed = np.concatenate([np.zeros(0, np.int32), *(handle.vertices for handle in handles)])
    free = np.setdiff1d(np.arange(n_vertices), prescribed)
    sliding = [handle for handle in handles if handle.free]
    axes = np.zeros((len(sliding), 3))
    for plate, handle in enumerate(sliding):
        axes[plate, list(handle.free)] = 1.0
    corners = cells.ravel()
    order = np.argsort(corners, kind="stable")
    return Unknowns(
        free.astype(np.int32),
        prescribed.astype(np.int32),
        np.cumsum([0, *(len(handle.vertices) for handle in sliding)], dtype=np.int32),
        np.concatenate([np.zeros(0, np.int32), *(handle.vertices for handle in sliding)]).astype(np.int32),
        axes,
        np.searchsorted(corners[order], np.arange(n_vertices + 1)).astype(np.int32),
        order.astype(np.int32),
    )


@kernel
def place(u, base, unknowns, x):
    """Write positions ``x`` (n, 3) from the unknowns ``u`` (3 r,) and the plates' commanded positions ``base``."""
    count = len(unknowns.free)
    for row in range(count):
        v = unknowns.free[row]
        for axis in range(3):
            x[v, axis] = u[3 * row + axis]
    for plate in range(len(unknowns.plate_axes)):
        for i in range(unknowns.plate_start[plate], unknowns.plate_start[plate + 1]):
            v = unknowns.plate_vertices[i]
            for axis in range(3):
                x[v, axis] = base[v, axis] + unknowns.plate_axes[plate, axis] * u[3 * (count + plate) + axis]


@kernel
def gather_rows(force, unknowns, gradient):
    """Sum corner forces (m, 8, 3) into the rows of ``gradient`` (3 r,), in an order that is always the same."""
    count = len(unknowns.free)
    for row in range(count):
        s = vertex_force(force, unknowns, unknowns.free[row])
        gradient[3 * row], gradient[3 * row + 1], gradient[3 * row + 2] = s
    for plate in range(len(unknowns.plate_axes)):
        t0, t1, t2 = 0.0, 0.0, 0.0
        for i in range(unknowns.plate_start[plate], unknowns.plate_start[plate + 1]):
            s0, s1, s2 = vertex_force(force, unknowns, unknowns.plate_vertices[i])
            t0, t1, t2 = t0 + s0, t1 + s1, t2 + s2
        row = 3 * (count + plate)
        gradient[row] = t0 * unknowns.plate_axes[plate, 0]
        gradient[row + 1] = t1 * unknowns.plate_axes[plate, 1]
        gradient[row + 2] = t2 * unknowns.plate_axes[plate, 2]


@kernel
def add_rows(outside, unknowns, gradient):
    """Add vertex forces (n, 3) to the rows of ``gradient`` (3 r,)."""
    count = len(unknowns.free)
    for row in range(count):
        v = unknowns.free[row]
        for axis in range(3):
            gradient[3 * row + axis] += outside[v, axis]
    for plate in range(len(unknowns.plate_axes)):
        for i in range(unknowns.plate_start[plate], unknowns.plate_start[plate + 1]):
            v = unknowns.plate_vertices[i]
            for axis in range(3):
                gradient[3 * (count + plate) + axis] += unknowns.plate_axes[plate, axis] * outside[v, axis]


@inlined
def vertex_force(force, unknowns, vertex):
    """Sum the forces (m, 8, 3) of the element corners at one vertex."""
    s0, s1, s2 = 0.0, 0.0, 0.0
    for i in range(unknowns.corner_start[vertex], unknowns.corner_start[vertex + 1]):
        e, a = unknowns.corner[i] >> 3, unknowns.corner[i] & 7
        s0 += force[e, a, 0]
        s1 += force[e, a, 1]
        s2 += force[e, a, 2]
    return s0, s1, s2
