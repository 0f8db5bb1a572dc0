# SPDX-License-Identifier: Apache-2.0
"""Compliance W = J H J^T of contact points, with the quasi-Newton method's approximate inverse H of the Hessian.

J is the derivative of gaps and slips with respect to the unknowns. H is the inverse M^-1 of the initial matrix, updated
by the pairs (s, y) of L-BFGS. With rho = 1 / s . y, each pair turns the operator H into H - rho (s z^T + z s^T) + rho
(1 + rho y . z) s s^T, where z = H y. As the directions are -H g, two successive ones contain z, and with the z of all
pairs, a change of forces turns the direction at the cost of little more than half of a solution.

M turns with the rotations R of the vertices: M^-1 = R C R^T. C is constant as long as M is kept (see `kept_columns`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.mesh.triples import along
from gdfe_ros.solver.contact.field import PointField
from gdfe_ros.solver.contact.kept_columns import ConstantColumns, HalvedColumns, KeptColumns
from gdfe_ros.solver.descent.lbfgs_workspace import MEMORY, Problem, Workspace, inner
from gdfe_ros.solver.descent.loop import Metric, apply_initial
from gdfe_ros.solver.vectors import NEGLIGIBLE, largest


@internal
def turn_blocks(chosen, rows, blocks, counts, frames):
    """Return the ``blocks`` (c, e, 3, 3) of the ``chosen`` points, rotated to the ``frames`` (f, 9) of the vertices."""
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
    """Return the rows without a ``place`` (r,) on which the ``chosen`` points depend; rows may appear repeatedly."""
    found, count = np.empty(len(chosen) * rows.shape[1], np.int64), 0
    for i in chosen:
        for e in range(counts[i]):
            if place[rows[i, e]] < 0:
                found[count] = rows[i, e]
                count += 1
    return found[:count].copy()


@internal
def list_places(chosen, rows, counts, place, most):
    """Return the places, all below ``most``, of all rows on which the ``chosen`` points depend."""
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

    ``between`` (3 m, 3 m) is the known part of C, and ``place`` (r,) the place of each row in it.
    """
    turned, half = turn_blocks(chosen, rows, blocks, counts, frames), np.empty((3, len(between)))
    places = list_places(chosen, rows, counts, place, len(between) // 3)
    for c in range(len(chosen)):
        for k in range(3):
            for b in places:
                half[k, 3 * b], half[k, 3 * b + 1], half[k, 3 * b + 2] = 0.0, 0.0, 0.0
            for e in range(counts[chosen[c]]):
                at, t = 3 * place[rows[chosen[c], e]], turned[c, e, k]
                x, y, z = between[at], between[at + 1], between[at + 2]
                for b in places:
                    for n in range(3 * b, 3 * b + 3):
                        half[k, n] += t[0] * x[n] + t[1] * y[n] + t[2] * z[n]
        for d in range(c, len(chosen)):
            for j in range(3):
                total = 0.0, 0.0, 0.0
                for f in range(counts[chosen[d]]):
                    at, t = 3 * place[rows[chosen[d], f]], turned[d, f, j]
                    for n in range(3):
                        total = along(1.0, total, t[n], (half[0, at + n], half[1, at + n], half[2, at + n]))
                for k in range(3):
                    out[3 * c + k, 3 * d + j] = total[k]
    for a in range(len(out)):
        for b in range(a):
            out[a, b] = out[b, a]


@internal
def project_one(vector, i, rows, blocks, counts, k):
    """Return one component [m] of J ``vector`` for point ``i``."""
    total = 0.0
    for e in range(counts[i]):
        for j in range(3):
            total += blocks[i, e, k, j] * vector[3 * rows[i, e] + j]
    return total


class PointCompliance(NamedTuple):
    """The computed parts of the compliance of the points that take part in a step.

    Attributes:
        place, between: see `KeptColumns`.
        frames: (f, 9) the rotations of the vertices for which `joined` holds; none for the constant matrix.
        products, curvature: for each pair (s, y) of L-BFGS, z = H y (memory, 3 r) with the H of all older pairs, and
            s . y (memory,), which is NaN if z is not known.
        pairs: (3,) row of the oldest pair to which the products belong, and the row of the next pair and the number of
            pairs at the last step; the number is -1 if M has changed since that step.
        last_direction: (3 r,) direction of the last step.
        wild: (1,) whether the constant matrix replaces the tangent for this minimisation only.
        scale: (1,) factor of the inverse of the constant matrix while it replaces the tangent, otherwise 1.
        valid: (1,) whether `joined` is J M^-1 J^T of points with the derivatives `rows`, `blocks` and `used`.
        joined, w: (3 c, 3 c) [m/N] J M^-1 J^T without the scale, and the compliance W.
        rows, blocks, used: derivatives of the points in `joined`, see `PointField`.
        q, forces: (3 c,) displacements without forces [m], and forces [N].
    """

    place: NDArray[np.int64]
    between: NDArray[np.float64]
    frames: NDArray[np.float64]
    products: NDArray[np.float64]
    curvature: NDArray[np.float64]
    pairs: NDArray[np.int64]
    last_direction: NDArray[np.float64]
    wild: NDArray[np.int64]
    scale: NDArray[np.float64]
    valid: NDArray[np.bool_]
    joined: NDArray[np.float64]
    w: NDArray[np.float64]
    rows: NDArray[np.int64]
    blocks: NDArray[np.float64]
    used: NDArray[np.int64]
    q: NDArray[np.float64]
    forces: NDArray[np.float64]


@internal
def follow_frames(frames, known):
    """Store the present rotations of the vertices; if they have changed, mark the stored products as invalid."""
    same = True
    for n in range(len(known.frames)):
        for k in range(9):
            same &= frames[n, k] == known.frames[n, k]
            known.frames[n, k] = frames[n, k]
    if not same:
        known.valid[0] = False
        forget_pairs(known)


@internal
def forget_pairs(known):
    """Mark all products with the pairs as unknown, because M has changed."""
    known.curvature[:] = np.nan
    known.pairs[2] = -1


@internal
def is_joined(field, chosen, known):
    """Return whether `PointCompliance.joined` still is valid for the ``chosen`` points; store their derivatives."""
    same = known.valid[0]
    for c in range(len(chosen)):
        i = chosen[c]
        same &= known.used[c] == field.used[i]
        known.used[c] = field.used[i]
        for e in range(field.used[i]):
            same &= known.rows[c, e] == field.rows[i, e]
            known.rows[c, e] = field.rows[i, e]
            for k in range(3):
                for j in range(3):
                    same &= known.blocks[c, e, k, j] == field.blocks[i, e, k, j]
                    known.blocks[c, e, k, j] = field.blocks[i, e, k, j]
    known.valid[0] = True
    return same


@internal
def find_compliance(work, metric, field, known, count, turned):
    """Write W [m/N] of the first ``count`` chosen points to ``known.w``.

    ``turned`` tells whether the direction and the newest pair of L-BFGS belong to the present gradient.

    Return False if `Compliance.prepare` must be called first.
    """
    status, chosen = work.status[0], field.chosen[:count]
    given = chosen, field.rows, field.blocks, field.used
    if known.wild[0] != status.wild or len(known.w) != 3 * count or known.rows.shape[1] != field.rows.shape[1]:
        return False
    if len(find_unknown(chosen, field.rows, field.used, known.place)) > 0:
        return False
    scale = status.scale if status.wild == 1 else 1.0
    follow_frames(metric.kept.frames, known)
    if known.scale[0] != scale:
        forget_pairs(known)
        known.scale[0] = scale
    if not is_joined(field, chosen, known):
        join(*given, known.place, known.between, known.frames, known.joined)
    known.w[:] = scale * known.joined
    find_products(work, metric, known, turned)
    add_pairs(work, known.products, *given, known.w)
    for c in range(count):
        known.w[3 * c, 3 * c] += field.stencils.soft[chosen[c]]
    return True


@internal
def add_inertia(field, known, count, inertia):
    """Resist motions of the points along each axis in which they can move."""
    for k in range(3 * count):
        if known.w[k, k] > 0.0:
            known.w[k, k] += inertia / field.stencils.scale[field.chosen[k // 3]]


@internal
def find_products(work, metric, known, turned):
    """Find the products z = H y of all pairs of L-BFGS that are not known yet; ``turned``: see `find_compliance`."""
    status, memory, first = work.status[0], len(known.curvature), 0
    oldest = (status.head - status.count) % memory
    while known.pairs[0] == oldest and first < status.count:
        at = (oldest + first) % memory
        if known.curvature[at] != work.curvature[at]:
            break
        first += 1
    newest = (status.head - 1) % memory
    follows = known.pairs[1] == newest and known.pairs[2] == status.count - 1
    if turned and follows and first == status.count - 1 and find_newest(work, known, newest):
        first += 1
    if first < status.count:
        rows = (oldest + np.arange(first, status.count)) % memory
        images = np.empty((len(rows), len(work.u)))
        apply_initial(status, metric, work.changes[rows], images)
        for k in range(first, status.count):
            at, z = (oldest + k) % memory, images[k - first]
            for i in range(k):
                add_pair(work, known.products, (oldest + i) % memory, work.changes[at], z)
            known.products[at] = z
    known.pairs[0] = oldest
    for k in range(status.count):
        at = (oldest + k) % memory
        known.curvature[at] = work.curvature[at]


@internal
def find_newest(work, known, at):
    """Find the product z = H y of the newest pair, in row ``at``, from the last two directions, without a solution.

    The directions are d = -H g, and d' = -H' g' with H' = H + the pair's update. From y = g' - g follows, with
    a = s . g' / s . y,

        z = (d - d' - c s) / (1 - a),   c = a + (a (d - d') . y - (d - d') . g') / (s . y - s . g').

    Return False if too many digits would cancel.
    """
    s, y, z, gradient = work.steps[at], work.changes[at], known.products[at], work.gradient
    along = inner(s, gradient) / work.curvature[at]
    for n in range(len(z)):
        z[n] = known.last_direction[n] - work.direction[n]
    if not 1.0 - along > NEGLIGIBLE or not largest(z) > NEGLIGIBLE * largest(known.last_direction):
        return False
    c = along + (along * inner(z, y) - inner(z, gradient)) / (work.curvature[at] * (1.0 - along))
    for n in range(len(z)):
        z[n] = (z[n] - c * s[n]) / (1.0 - along)
    return True


@internal
def add_pair(work, products, at, vector, out):
    """Add the update by the pair in row ``at`` to ``out``, the product of H and a ``vector``."""
    s, z, rho = work.steps[at], products[at], 1.0 / work.curvature[at]
    first, second = rho * inner(s, vector), rho * inner(z, vector)
    first, second = (1.0 + rho * inner(work.changes[at], z)) * first - second, first
    for n in range(len(out)):
        out[n] += first * s[n] - second * z[n]


@internal
def turn_direction(work, metric, known, change):
    """Update the direction for a ``change`` v (3 r,) of the gradient [N]: add -H v. Return whether it descends.

    If v is zero in most rows, this costs little more than half of a solution.
    """
    status, moved, d = work.status[0], work.step, work.direction
    apply_initial(status, metric, change.reshape((1, -1)), moved.reshape((1, -1)))
    for k in range(status.count):
        add_pair(work, known.products, (status.head - status.count + k) % len(known.curvature), change, moved)
    for n in range(len(d)):
        d[n] -= moved[n]
    status.slope, status.step = inner(work.gradient, d), largest(d)
    return status.slope < 0.0


@internal
def add_pairs(work, products, chosen, rows, blocks, counts, out):
    """Add the updates by the pairs of L-BFGS to W.

    For each pair, W changes by js u^T + jz v^T, with js = J s, jz = J z, u = rho (1 + rho y . z) js - rho jz and
    v = -rho js.
    """
    status, size = work.status[0], 3 * len(chosen)
    js, jz = np.empty((2, size))
    for k in range(status.count):
        at = (status.head - status.count + k) % len(work.curvature)
        s, z, rho = work.steps[at], products[at], 1.0 / work.curvature[at]
        own = rho * (1.0 + rho * inner(work.changes[at], z))
        for a in range(size):
            js[a] = project_one(s, chosen[a // 3], rows, blocks, counts, a % 3)
            jz[a] = project_one(z, chosen[a // 3], rows, blocks, counts, a % 3)
        for a in range(size):
            first, second = own * js[a] - rho * jz[a], -rho * js[a]
            for b in range(size):
                out[a, b] += first * js[b] + second * jz[b]


class Compliance:
    """Provides the data of `find_compliance`, and keeps the data that do not change from step to step.

    Args:
        vertices: vertices on which contact forces can act, ascending.
        count: number 3 r of unknowns.
    """

    def __init__(self, vertices: NDArray[np.int32], count: int) -> None:
        self._vertices = vertices
        self._pairs = np.zeros((MEMORY, count)), np.full(MEMORY, np.nan), np.zeros(3, np.int64), np.zeros(count)
        self._columns: dict[bool, tuple[tuple[object, ...], KeptColumns]] = {}
        self.known: PointCompliance | None = None

    def prepare(
        self, problem: Problem, work: Workspace, metric: Metric, key: tuple[object, ...], field: PointField, count: int
    ) -> PointCompliance:
        """Return the compliance data for the first ``count`` chosen points of a ``field``.

        If ``count`` is negative, the data are those of the points in the last call. Columns of an earlier tangent are
        dropped. The constant matrix may replace the tangent for a while; its columns are kept beside those of the
        tangent. ``key`` has the arrays that identify the tangent.
        """
        free, wild, known = problem.unknowns.free, int(work.status[0]["wild"]), self.known
        constant = bool(wild) or not len(metric.kept.order)
        source = (metric.coupling.inverse_schur, free) if constant else key
        before, columns = self._columns.get(constant, ((), None))
        if len(source) != len(before) or any(a is not b for a, b in zip(source, before, strict=True)):
            needed = np.flatnonzero(np.isin(free, self._vertices))
            columns = ConstantColumns(metric.coupling, needed, len(free)) if constant else HalvedColumns(metric.kept)
            self._columns[constant], known = (source, columns), None
        chosen, width = field.chosen[: max(count, 0)], field.rows.shape[1]
        if count < 0:
            count, width = (0, 0) if known is None else (len(known.used), known.rows.shape[1])
        else:
            columns.include(find_unknown(chosen, field.rows, field.used, columns.place))
        frames = np.zeros((0, 9)) if constant else metric.kept.frames
        if known is None or known.wild[0] != wild or len(known.w) != 3 * count or known.rows.shape[1] != width:
            numbers_of = np.array([wild]), np.full(1, np.nan), np.zeros(1, np.bool_)
            seen = np.zeros((count, width), np.int64), np.zeros((count, width, 3, 3)), np.zeros(count, np.int64)
            self._pairs[1][...], self._pairs[2][2] = np.nan, -1
            given = frames.copy(), *self._pairs, *numbers_of, *np.empty((2, 3 * count, 3 * count))
            known = PointCompliance(columns.place, columns.between, *given, *seen, *np.zeros((2, 3 * count)))
        self.known = known._replace(place=columns.place, between=columns.between)
        return self.known
