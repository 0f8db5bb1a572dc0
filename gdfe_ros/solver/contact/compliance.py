# SPDX-License-Identifier: Apache-2.0
"""Compliance W = J H J^T of contact points, with H the inverse Hessian of the quasi-Newton method.

H is the inverse M^-1 of the initial matrix, changed by the pairs (s, y) of L-BFGS. With rho = 1 / s . y, each pair
turns the operator H into H - rho (s z^T + z s^T) + rho (1 + rho y . z) s s^T, where z = H y.

M turns with the vertices: M^-1 = R C R^T, and C is constant as long as M is kept, see `kept_columns`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.solver.contact.field import PointField
from gdfe_ros.solver.contact.kept_columns import ConstantColumns, HalvedColumns, KeptColumns
from gdfe_ros.solver.descent.loop import Metric, apply_initial
from gdfe_ros.solver.descent.workspace import MEMORY, Problem, Workspace, inner, numbers
from gdfe_ros.solver.matrix.rotation import left_jacobian_transposed
from gdfe_ros.solver.matrix.unknowns import rigid_part


@kernel
def differentiate(x, u, frame, unknowns, row_of, handle_of, axes, ends, pressing, rubbing, rows, blocks, counts):
    """Write the derivative of each point's gap and slip with respect to the rows of unknowns.

    ``row_of`` and ``handle_of`` (n,) are the row of each free vertex, and the number of each vertex' handle with a free
    axis; otherwise -1. ``axes``, ``ends``, ``pressing`` and ``rubbing`` are those of `Stencils`. The results are the
    ``rows`` (k, e) on which each point depends, their number ``counts`` (k,), and the derivatives ``blocks``
    (k, e, 3, 3).
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
    """Return the place of a row among those of point ``i``; append it if it is new."""
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


@internal
def turn_blocks(chosen, rows, blocks, counts, frames):
    """Return the ``blocks`` (c, e, 3, 3) of the ``chosen`` points in the frames (f, 9) of the vertices."""
    turned = np.empty((len(chosen), rows.shape[1], 3, 3))
    for c in range(len(chosen)):
        i = chosen[c]
        for e in range(counts[i]):
            row = rows[i, e]
            for k in range(3):
                for j in range(3):
                    if row < len(frames):
                        total = 0.0
                        for m in range(3):
                            total += blocks[i, e, k, m] * frames[row, 3 * m + j]
                        turned[c, e, k, j] = total
                    else:
                        turned[c, e, k, j] = blocks[i, e, k, j]
    return turned


@kernel
def find_unknown(chosen, rows, counts, place):
    """Return the rows on which the ``chosen`` points depend and that have no ``place`` (r,); some more than once."""
    found, count = np.empty(len(chosen) * rows.shape[1], np.int64), 0
    for i in chosen:
        for e in range(counts[i]):
            if place[rows[i, e]] < 0:
                found[count] = rows[i, e]
                count += 1
    return found[:count].copy()


@internal
def list_places(chosen, rows, counts, place, most):
    """Return the places of all rows on which the ``chosen`` points depend; all are below ``most``."""
    found, listed, count = np.empty(most, np.int64), np.zeros(most, np.bool_), 0
    for i in chosen:
        for e in range(counts[i]):
            at = place[rows[i, e]]
            if not listed[at]:
                found[count], listed[at] = at, True
                count += 1
    return found[:count]


@kernel
def join(chosen, rows, blocks, counts, place, between, frames, out):
    """Write J M^-1 J^T (3 c, 3 c) [m/N] of the ``chosen`` points; ``frames`` (f, 9) rotate the vertices.

    ``place`` (r,) is the place of each row in C, which is ``between`` (3 m, 3 m).
    """
    turned, half = turn_blocks(chosen, rows, blocks, counts, frames), np.empty(len(between))
    places = list_places(chosen, rows, counts, place, len(between) // 3)
    for c in range(len(chosen)):
        for k in range(3):
            for b in places:
                half[3 * b], half[3 * b + 1], half[3 * b + 2] = 0.0, 0.0, 0.0
            for e in range(counts[chosen[c]]):
                at = 3 * place[rows[chosen[c], e]]
                t0, t1, t2 = turned[c, e, k, 0], turned[c, e, k, 1], turned[c, e, k, 2]
                for b in places:
                    for n in range(3 * b, 3 * b + 3):
                        half[n] += t0 * between[at, n] + t1 * between[at + 1, n] + t2 * between[at + 2, n]
            for d in range(c, len(chosen)):
                for j in range(3):
                    total = 0.0
                    for f in range(counts[chosen[d]]):
                        at = 3 * place[rows[chosen[d], f]]
                        for n in range(3):
                            total += half[at + n] * turned[d, f, j, n]
                    if d > c or j >= k:
                        out[3 * c + k, 3 * d + j] = total
                        out[3 * d + j, 3 * c + k] = total


@internal
def project_one(vector, i, rows, blocks, counts, k):
    """Return one component [m] of J ``vector`` for point ``i``."""
    total = 0.0
    for e in range(counts[i]):
        for j in range(3):
            total += blocks[i, e, k, j] * vector[3 * rows[i, e] + j]
    return total


@kernel
def add_history(work, metric, images, known, chosen, rows, blocks, counts, soft, w):
    """Add to W = J M^-1 J^T of the ``chosen`` points the change by the pairs of L-BFGS, and the points' springs.

    ``images`` (memory, 3 r) are products M^-1 y; those of pairs without a ``known`` (memory,) curvature are found.
    """
    status, memory = work.status[0], len(known)
    for k in range(status.count):
        at = (status.head - 1 - k) % memory
        if known[at] == work.curvature[at]:
            continue
        known[at] = work.curvature[at]
        apply_initial(status, metric, work.changes[at], images[at])
    if status.count > 0:
        add_pairs(work, images, chosen, rows, blocks, counts, w)
    for c in range(len(chosen)):
        w[3 * c, 3 * c] += soft[chosen[c]]


@internal
def add_pairs(work, images, chosen, rows, blocks, counts, out):
    """Add the change by the pairs of L-BFGS to W; ``images`` (memory, 3 r) are the products M^-1 y."""
    status, size = work.status[0], 3 * len(chosen)
    z = np.empty((status.count, len(work.u)))
    js, jz = np.empty(size), np.empty(size)
    for k in range(status.count):
        at = (status.head - status.count + k) % len(work.curvature)
        s, y, rho = work.steps[at], work.changes[at], 1.0 / work.curvature[at]
        z[k] = images[at]
        for i in range(k):
            older = (status.head - status.count + i) % len(work.curvature)
            first, rate = work.steps[older], 1.0 / work.curvature[older]
            sy, zy = inner(first, y), inner(z[i], y)
            own = rate * (1.0 + rate * inner(work.changes[older], z[i]))
            for n in range(len(y)):
                z[k, n] += own * sy * first[n] - rate * (zy * first[n] + sy * z[i, n])
        for c in range(len(chosen)):
            for axis in range(3):
                js[3 * c + axis] = project_one(s, chosen[c], rows, blocks, counts, axis)
                jz[3 * c + axis] = project_one(z[k], chosen[c], rows, blocks, counts, axis)
        own = rho * (1.0 + rho * inner(y, z[k]))
        for a in range(size):
            for b in range(size):
                out[a, b] += own * js[a] * js[b] - rho * (js[a] * jz[b] + jz[a] * js[b])


class Compliance:
    """Finds W, and keeps what does not change: columns of M^-1, J M^-1 J^T, and products of M^-1 with pairs of L-BFGS.

    Args:
        vertices: vertices on which contact forces can act, ascending.
        count: number 3 r of unknowns.
    """

    def __init__(self, vertices: NDArray[np.int32], count: int) -> None:
        self._vertices = vertices
        self._images, self._known = np.zeros((MEMORY, count)), np.full(MEMORY, np.nan)
        self._source: tuple[object, ...] = ()
        self._columns: KeptColumns
        self._joined = self._w = np.zeros((0, 0))
        self._seen: tuple[NDArray, ...] | None = None
        self._frames, self._scale = np.zeros((0, 9)), 1.0

    def of(
        self, problem: Problem, work: Workspace, metric: Metric, key: tuple[object, ...], field: PointField, count: int
    ) -> NDArray[np.float64]:
        """Return W (3 c, 3 c) [m/N] of the points that take part; the next call overwrites it."""
        chosen, columns = field.chosen[:count].copy(), self._take_matrix(problem, work, metric, key)
        given = chosen, field.rows, field.blocks, field.used
        if len(unknown := find_unknown(chosen, field.rows, field.used, columns.place)):
            columns.include(unknown)
        seen = field.used[chosen], field.rows[chosen], field.blocks[chosen]
        if self._seen is None or not all(map(np.array_equal, seen, self._seen)):
            self._seen = seen
            if len(self._joined) != 3 * count:
                self._joined, self._w = np.empty((2, 3 * count, 3 * count))
            join(*given, columns.place, columns.between, self._frames, self._joined)
            if self._scale != 1.0:
                self._joined *= self._scale
        self._w[...] = self._joined
        add_history(work, metric, self._images, self._known, *given, field.stencils.soft, self._w)
        return self._w

    def _take_matrix(self, problem: Problem, work: Workspace, metric: Metric, key: tuple[object, ...]) -> KeptColumns:
        """Return C of the present initial matrix; drop what belongs to another one, or to other rotations of vertices.

        ``key`` has the arrays of the tangent; the constant matrix is known by its own.
        """
        status, free = numbers(work), problem.unknowns.free
        wild = bool(status["wild"])
        constant, scale = wild or not len(metric.kept.order), float(status["scale"]) if wild else 1.0
        frames = np.zeros((0, 9)) if constant else metric.kept.frames
        source = (metric.coupling.inverse_schur, free) if constant else key
        if len(source) != len(self._source) or any(a is not b for a, b in zip(source, self._source, strict=True)):
            needed = np.flatnonzero(np.isin(free, self._vertices))
            columns = ConstantColumns(metric.coupling, needed, len(free)) if constant else HalvedColumns(metric.kept)
            self._source, self._columns = source, columns
        elif scale == self._scale and np.array_equal(frames, self._frames):
            return self._columns
        self._known[...], self._seen, self._frames, self._scale = np.nan, None, frames.copy(), scale
        return self._columns
