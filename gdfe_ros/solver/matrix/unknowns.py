# SPDX-License-Identifier: Apache-2.0
"""Numbering of the unknowns: free vertices, and the rigid motion of every handle with a free axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, internal, kernel, parallel_kernel
from gdfe_ros.constraints import Handle
from gdfe_ros.solver.matrix.rotation import left_jacobian_transposed, rotated, rotation_matrix


class Unknowns(NamedTuple):
    """Numbering of the unknowns (r, 3) in metres: the rows of the free vertices, then the rigid rows of handles.

    A handle with a free axis has a row for its translation. If it rotates freely, it has a second row: the rotation
    vector from its commanded orientation, times a radius. Components that are not free stay zero.

    Attributes:
        free: (f,) int32 vertex of each of the first f rows, including vertices on rollers.
        fixed: (k,) int64 components of the unknowns, as 3 row + axis, along which rollers hold a vertex. They are
            constant: gradients and directions are zero there.
        prescribed: (b,) int32 vertices of all handles except rollers, handle by handle.
        member_start: (p + 1,) int32, index in ``members`` at which each handle with a free axis begins.
        members: int32 vertices of these handles.
        slides: (p, 3) float64, 1 for a free translation, 0 for a prescribed one.
        turns: (p, 3) float64, 1 for a free rotation, 0 for a prescribed one.
        turn_row: (p,) int32, row of the rotation; -1 for a handle that does not rotate freely.
        radius: (p,) float64 [m], largest distance of any undeformed vertex of the body from the handle's centre: the
            whole body follows a rotation of the handle.
        corner_start: (n + 1,) int32, index in ``corner`` at which each vertex's list of element corners begins.
        corner: (c m,) int32, element times 8 plus corner (element times 16 for more than 8 corners). Each vertex sums
            its forces in this order.
    """

    free: NDArray[np.int32]
    fixed: NDArray[np.int64]
    prescribed: NDArray[np.int32]
    member_start: NDArray[np.int32]
    members: NDArray[np.int32]
    slides: NDArray[np.float64]
    turns: NDArray[np.float64]
    turn_row: NDArray[np.int32]
    radius: NDArray[np.float64]
    corner_start: NDArray[np.int32]
    corner: NDArray[np.int32]

    @property
    def rigid_rows(self) -> int:
        """Number of rows that belong to handles with a free axis."""
        return len(self.slides) + int((self.turn_row >= 0).sum())

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.free) + self.rigid_rows


class HandlePositions(NamedTuple):
    """Commanded positions of the handles.

    Attributes:
        base: (n, 3) positions [m] of the handles' vertices without free motion; other rows are not read.
        centre: (p, 3) centres [m] of the handles that have a free axis.
    """

    base: NDArray[np.float64]
    centre: NDArray[np.float64]


def number_unknowns(rest: NDArray[np.float64], cells: NDArray[np.int32], handles: Sequence[Handle]) -> Unknowns:
    """Return the numbering for vertices ``rest`` (n, 3) [m] and ``cells`` (m, c), with the given ``handles``."""
    whole = (handle.vertices for handle in handles if handle.slide is None)
    prescribed = np.concatenate([np.zeros(0, np.int32), *whole])
    free = np.setdiff1d(np.arange(len(rest)), prescribed)
    held = np.zeros((len(rest), 3), dtype=bool)
    for handle in (each for each in handles if each.slide is not None):
        held[handle.vertices] = ~handle.slide
    loose = [piece for handle in handles for piece in handle.pieces if piece.loose]
    slides, turns = np.zeros((len(loose), 3)), np.zeros((len(loose), 3))
    turn_row, row = np.full(len(loose), -1, dtype=np.int32), len(free) + len(loose)
    for p, handle in enumerate(loose):
        slides[p, list(handle.free)] = 1.0
        turns[p, list(handle.turning)] = 1.0
        if handle.turning:
            turn_row[p], row = row, row + 1
    arms = [np.linalg.norm(rest - handle.centre(rest), axis=1).max() for handle in loose]
    corners = cells.ravel()
    order = np.argsort(corners, kind="stable")
    return Unknowns(
        free.astype(np.int32),
        np.flatnonzero(held[free]),
        prescribed.astype(np.int32),
        np.cumsum([0, *(len(handle.vertices) for handle in loose)], dtype=np.int32),
        np.concatenate([np.zeros(0, np.int32), *(handle.vertices for handle in loose)]).astype(np.int32),
        slides,
        turns,
        turn_row,
        np.array(arms, dtype=np.float64),
        np.searchsorted(corners[order], np.arange(len(rest) + 1)).astype(np.int32),
        _numbered(order, cells.shape[1]),
    )


def _numbered(places: NDArray[np.int64], count: int) -> NDArray[np.int32]:
    """Return the element and corner of ``places`` in an array (m, count), packed as in `Unknowns.corner`."""
    element, corner = np.divmod(places, count)
    return ((element << shift_of(count)) + corner).astype(np.int32)


def shift_of(count: int) -> int:
    """Return the number of bits that hold the index of one of ``count`` corners."""
    return 3 if count <= 8 else 4


def handle_centres(positions: NDArray[np.float64], unknowns: Unknowns) -> NDArray[np.float64]:
    """Return the mean vertex positions (p, 3) [m] of the handles with a free axis, from ``positions`` (n, 3) [m]."""
    if not len(unknowns.slides):
        return np.zeros((0, 3))
    sums = np.add.reduceat(positions[unknowns.members], unknowns.member_start[:-1])
    return sums / np.diff(unknowns.member_start)[:, None]


@kernel
def place(u, frame, unknowns, x):
    """Write positions to ``x`` (n, 3) [m] from the unknowns ``u`` (3 r,) and the handles' commanded positions."""
    count = len(unknowns.free)
    for row in range(count):
        v = unknowns.free[row]
        for axis in range(3):
            x[v, axis] = u[3 * row + axis]
    for p in range(len(unknowns.slides)):
        shift = rigid_part(u, count + p, unknowns.slides, p, 1.0)
        if unknowns.turn_row[p] >= 0:
            turn = rigid_part(u, unknowns.turn_row[p], unknowns.turns, p, 1.0 / unknowns.radius[p])
            r = rotation_matrix(turn)
        for i in range(unknowns.member_start[p], unknowns.member_start[p + 1]):
            v = unknowns.members[i]
            if unknowns.turn_row[p] < 0:
                for axis in range(3):
                    x[v, axis] = frame.base[v, axis] + shift[axis]
            else:
                arm = rotated(
                    r,
                    frame.base[v, 0] - frame.centre[p, 0],
                    frame.base[v, 1] - frame.centre[p, 1],
                    frame.base[v, 2] - frame.centre[p, 2],
                )
                for axis in range(3):
                    x[v, axis] = frame.centre[p, axis] + shift[axis] + arm[axis]


@kernel
def gather_rows(force, unknowns, gradient):
    """Sum corner forces (m, c, 3) into the rows of free vertices, in a fixed order."""
    gather_part(force, unknowns, gradient, 0, len(unknowns.free))
    clear_fixed(unknowns.fixed, gradient)


@internal
def gather_part(force, unknowns, gradient, first, last):
    """Do `gather_rows` for the rows from ``first`` up to ``last``."""
    for row in range(first, last):
        s = vertex_force(force, unknowns, unknowns.free[row])
        gradient[3 * row], gradient[3 * row + 1], gradient[3 * row + 2] = s


@parallel_kernel
def gather_in_threads(threads, force, unknowns, gradient):
    """Do `gather_rows` with the rows divided among threads."""
    count = len(unknowns.free)
    for part in prange(threads):
        gather_part(force, unknowns, gradient, part * count // threads, (part + 1) * count // threads)
    clear_fixed(unknowns.fixed, gradient)


@internal
def clear_fixed(fixed, vector):
    """Set the ``fixed`` components of a gradient or a direction (3 r,) to zero."""
    for i in range(len(fixed)):
        vector[fixed[i]] = 0.0


@kernel
def add_rows(outside, unknowns, gradient):
    """Add vertex forces (n, 3) to the rows of free vertices."""
    for row in range(len(unknowns.free)):
        v = unknowns.free[row]
        for axis in range(3):
            gradient[3 * row + axis] += outside[v, axis]
    clear_fixed(unknowns.fixed, gradient)


@kernel
def gather_rigid_rows(u, x, force, outside, pushed, frame, unknowns, gradient):
    """Write the rigid rows of ``gradient`` (3 r,): dE/dt, and dE/dtheta = J_l(theta)^T moment / radius.

    ``force`` (m, c, 3) [N] are corner forces. ``outside`` (n, 3) [N] are the forces of all other terms; they are added
    only if ``pushed``.
    """
    count = len(unknowns.free)
    for p in range(len(unknowns.slides)):
        f0, f1, f2, m0, m1, m2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        shift = rigid_part(u, count + p, unknowns.slides, p, 1.0)
        c0, c1, c2 = frame.centre[p, 0] + shift[0], frame.centre[p, 1] + shift[1], frame.centre[p, 2] + shift[2]
        for i in range(unknowns.member_start[p], unknowns.member_start[p + 1]):
            v = unknowns.members[i]
            s0, s1, s2 = vertex_force(force, unknowns, v)
            if pushed:
                s0, s1, s2 = s0 + outside[v, 0], s1 + outside[v, 1], s2 + outside[v, 2]
            f0, f1, f2 = f0 + s0, f1 + s1, f2 + s2
            r0, r1, r2 = x[v, 0] - c0, x[v, 1] - c1, x[v, 2] - c2
            m0, m1, m2 = m0 + r1 * s2 - r2 * s1, m1 + r2 * s0 - r0 * s2, m2 + r0 * s1 - r1 * s0
        row = 3 * (count + p)
        gradient[row] = f0 * unknowns.slides[p, 0]
        gradient[row + 1] = f1 * unknowns.slides[p, 1]
        gradient[row + 2] = f2 * unknowns.slides[p, 2]
        if unknowns.turn_row[p] >= 0:
            row = 3 * unknowns.turn_row[p]
            turn = rigid_part(u, unknowns.turn_row[p], unknowns.turns, p, 1.0 / unknowns.radius[p])
            moment = left_jacobian_transposed(turn, (m0, m1, m2))
            for axis in range(3):
                gradient[row + axis] = moment[axis] * unknowns.turns[p, axis] / unknowns.radius[p]


@inlined
def rigid_part(u, row, mask, p, scale):
    """Return a rigid row times ``scale``; components that are not free are zero."""
    return (
        mask[p, 0] * u[3 * row] * scale,
        mask[p, 1] * u[3 * row + 1] * scale,
        mask[p, 2] * u[3 * row + 2] * scale,
    )


@inlined
def vertex_force(force, unknowns, vertex):
    """Return the sum of the forces (m, c, 3) of the element corners at one vertex."""
    s0, s1, s2 = 0.0, 0.0, 0.0
    shift = 3 if force.shape[1] <= 8 else 4
    for i in range(unknowns.corner_start[vertex], unknowns.corner_start[vertex + 1]):
        e = unknowns.corner[i] >> shift
        a = unknowns.corner[i] - (e << shift)
        s0 += force[e, a, 0]
        s1 += force[e, a, 1]
        s2 += force[e, a, 2]
    return s0, s1, s2
