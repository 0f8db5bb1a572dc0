# SPDX-License-Identifier: Apache-2.0
"""Numbering of the unknowns: free vertices, and the rigid motion of every handle with a free axis."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.compiled import inlined, internal, kernel, parallel_kernel
from gdfe_ros.constraints import Handle
from gdfe_ros.materials.tensor import scale_vector, times
from gdfe_ros.mesh.triples import corner, cross, minus, plus
from gdfe_ros.solver.matrix.rotation import apply_left_jacobian, left_jacobian_transposed, rotation_matrix
from gdfe_ros.solver.vectors import Array


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
        radius: (p,) float64 [m], largest distance of any undeformed vertex of the body from the handle's centre. All
            vertices count, because the whole body follows a rotation of the handle.
        corner_start: (n + 1,) int32, index in ``corner`` at which each vertex's list of element corners begins.
        corner: (c m, 2) int32 pairs of an element and one of its corners. Each vertex sums its forces in this order.
    """

    free: NDArray[np.int32]
    fixed: NDArray[np.int64]
    prescribed: NDArray[np.int32]
    member_start: NDArray[np.int32]
    members: NDArray[np.int32]
    slides: Array
    turns: Array
    turn_row: NDArray[np.int32]
    radius: Array
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

    base: Array
    centre: Array


def number_unknowns(rest: Array, cells: NDArray[np.int32], handles: Sequence[Handle]) -> Unknowns:
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
        np.stack(np.divmod(order, cells.shape[1]), axis=1).astype(np.int32),
    )


def handle_centres(positions: Array, unknowns: Unknowns) -> Array:
    """Return the mean vertex positions (p, 3) [m] of the handles with a free axis, from ``positions`` (n, 3) [m]."""
    if not len(unknowns.slides):
        return np.zeros((0, 3))
    sums = np.add.reduceat(positions[unknowns.members], unknowns.member_start[:-1])
    return sums / np.diff(unknowns.member_start)[:, None]


def generalise(forces: Array, unknowns: Unknowns, motion: Array) -> Array:
    """Return the generalised forces (..., 3 r) on the unknowns for vertex forces (..., n, 3).

    ``motion`` (3 b, 3 q) is the result of `rigid_motion`.
    """
    own, beside = forces[..., unknowns.free, :], forces[..., unknowns.members, :]
    own = own.reshape(*own.shape[:-2], 3 * len(unknowns.free))
    own[..., unknowns.fixed] = 0.0
    return np.concatenate([own, beside.reshape(*beside.shape[:-2], len(motion)) @ motion], axis=-1)


def rigid_motion(u: Array, frame: HandlePositions, unknowns: Unknowns) -> Array:
    """Return d(positions of the handles' vertices)/d(rigid rows), (3 b, 3 q), at the unknowns ``u`` (3 r,).

    A vertex whose vector from the centre is a in the commanded orientation moves by dt + (J_l(theta) dtheta) x R a.
    """
    motion, rows = np.zeros((len(unknowns.members), 3, 3 * unknowns.rigid_rows)), u.reshape(-1, 3)
    for p, (begin, end) in enumerate(pairwise(unknowns.member_start)):
        own, turn = motion[begin:end], unknowns.turn_row[p]
        own[:, :, 3 * p : 3 * p + 3] = np.diag(unknowns.slides[p])
        if turn >= 0:
            first, shares = 3 * (turn - len(unknowns.free)), unknowns.turns[p] / unknowns.radius[p]
            arms = frame.base[unknowns.members[begin:end]] - frame.centre[p]
            arms = Rotation.from_rotvec(rows[turn] * shares).apply(arms)
            axes = apply_left_jacobian((rows[turn] * shares)[None], np.diag(shares))
            own[:, :, first : first + 3] = np.moveaxis(np.cross(axes, arms[:, None]), 1, 2)
    return motion.reshape(3 * len(motion), motion.shape[2])


@kernel
def place(u, frame, unknowns, x):
    """Write positions to ``x`` (n, 3) [m] from the unknowns ``u`` (3 r,) and the handles' commanded positions."""
    count = len(unknowns.free)
    for row in range(count):
        v = unknowns.free[row]
        for axis in range(3):
            x[v, axis] = u[3 * row + axis]
    for p in range(len(unknowns.slides)):
        shift, centre = rigid_part(u, count + p, unknowns.slides, p, 1.0), corner(frame.centre, p)
        if unknowns.turn_row[p] >= 0:
            r = rotation_matrix(rigid_part(u, unknowns.turn_row[p], unknowns.turns, p, 1.0 / unknowns.radius[p]))
        for i in range(unknowns.member_start[p], unknowns.member_start[p + 1]):
            v = unknowns.members[i]
            there = corner(frame.base, v)
            if unknowns.turn_row[p] >= 0:
                there = plus(centre, times(r, minus(there, centre)))
            x[v, 0], x[v, 1], x[v, 2] = plus(there, shift)


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
        total, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        centre = plus(corner(frame.centre, p), rigid_part(u, count + p, unknowns.slides, p, 1.0))
        for i in range(unknowns.member_start[p], unknowns.member_start[p + 1]):
            v = unknowns.members[i]
            s = vertex_force(force, unknowns, v)
            if pushed:
                s = plus(s, corner(outside, v))
            total, moment = plus(total, s), plus(moment, cross(minus(corner(x, v), centre), s))
        for axis in range(3):
            gradient[3 * (count + p) + axis] = total[axis] * unknowns.slides[p, axis]
        if unknowns.turn_row[p] >= 0:
            row = 3 * unknowns.turn_row[p]
            turn = rigid_part(u, unknowns.turn_row[p], unknowns.turns, p, 1.0 / unknowns.radius[p])
            moment = left_jacobian_transposed(turn, moment)
            for axis in range(3):
                gradient[row + axis] = moment[axis] * unknowns.turns[p, axis] / unknowns.radius[p]


@inlined
def rigid_part(u, row, mask, p, scale):
    """Return a rigid row times ``scale``; components that are not free are zero."""
    return scale_vector((mask[p, 0] * u[3 * row], mask[p, 1] * u[3 * row + 1], mask[p, 2] * u[3 * row + 2]), scale)


@inlined
def vertex_force(force, unknowns, vertex):
    """Return the sum of the forces (m, c, 3) of the element corners at one vertex."""
    total = 0.0, 0.0, 0.0
    for i in range(unknowns.corner_start[vertex], unknowns.corner_start[vertex + 1]):
        total = plus(total, corner(force[unknowns.corner[i, 0]], unknowns.corner[i, 1]))
    return total
