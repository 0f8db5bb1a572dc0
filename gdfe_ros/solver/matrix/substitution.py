# SPDX-License-Identifier: Apache-2.0
"""Compiled solutions with a sparse factor K = U^T U: forward and backward, supernode by supernode.

A factor with three rows for each vertex solves for one right-hand side at a time. A factor with one row for each vertex
solves for x, y and z together, and each supernode's part of it is read once for all three. A large factor fits into no
cache, so that reading it dominates the time of a solution. It is therefore stored in single precision.

Two corrections follow, if a body needs them. First, handles with a free axis have rigid rows in addition to the rows of
the factor; their Schur complement S is dense. Second, springs of lengths and volumes add G^T G to K; as a part of K,
these entries would fill the factor. With W = K^-1 G^T, the solution x without springs becomes x - W (1 + G W)^-1 G x
(Sherman, Morrison and Woodbury).

Entries of the inverse K^-1 = Y^T Y come from columns of Y = U^-T. A column of Y needs only the forward substitution, in
the supernodes on the path from its row to the root of the elimination tree. It costs half of a solution or less. The
operations of each entry, and their order, do not depend on the other entries that are computed together with it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import uint64
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, internal, kernel, vector_internal, vector_kernel
from gdfe_ros.solver.matrix.panels import PANEL, TILE, expand_rows, expand_three, reduce_rows, reduce_three
from gdfe_ros.solver.matrix.unknowns import clear_fixed
from gdfe_ros.solver.vectors import Array, clear_part, copy_part


class Plan(NamedTuple):
    """Index arrays of the kernels: see `Elimination`.

    Attributes:
        first, row_start, rows, inside: index arrays of the elimination.
        children, child_start: (c,) and (s + 1,), children of all supernodes, and offset of each supernode's children.
        parent: (s,) each supernode's parent; -1 for none.
        part_start: (s + 1,) offset of each supernode's blocks of the matrix.
        value_start: (s + 1,) offset of each supernode's rows of the factor.
    """

    first: NDArray[np.int64]
    row_start: NDArray[np.int64]
    rows: NDArray[np.int64]
    inside: NDArray[np.int64]
    children: NDArray[np.int64]
    child_start: NDArray[np.int64]
    parent: NDArray[np.int64]
    part_start: NDArray[np.int64]
    value_start: NDArray[np.int64]


class Inverse(NamedTuple):
    """The inverse (f, f) of a matrix with one row for each vertex, stored as a factor; it serves x, y and z.

    It is never modified, so several threads may use it at the same time.

    Attributes:
        plan: index arrays of the factor.
        order: (f,) vertices in the order of their elimination.
        values: entries of the factor, in single precision for a large factor, otherwise in double precision. Kernels
            are compiled once for each precision.
    """

    plan: Plan
    order: NDArray[np.int64]
    values: NDArray[np.floating]


class Kept(NamedTuple):
    """A factor for the kernels, with q rigid rows and m springs.

    Attributes:
        plan: the index arrays.
        values: entries of the factor, in single or double precision; the next factorisation overwrites them.
        order: (f,) vertices in the order of their elimination.
        harmonic: (3 f, q) displacement of the free vertices that each rigid row causes, times -1.
        schur: (q, q) inverse of the Schur complement S.
        springs: (m, 3 f + q) rows G.
        reach: (m, 3 f + q) rows of W^T.
        inner: (m, m) inverse of 1 + G W.
        frames: (f, 9) rotations of the vertices since the factor was computed; solutions follow them.
        fixed: (k,) int64 components that are constant (`Unknowns.fixed`); the factor does not couple them to other
            components.
    """

    plan: Plan
    values: NDArray[np.floating]
    order: NDArray[np.int64]
    harmonic: Array
    schur: Array
    springs: Array
    reach: Array
    inner: Array
    frames: Array
    fixed: NDArray[np.int64]

    @classmethod
    def none(cls) -> Kept:
        """Return an empty factor; with it, the constant matrix is the preconditioner."""
        index, squares = np.zeros(0, np.int64), [np.zeros((0, 0))] * 5
        return cls(Plan(*[index] * 9), np.zeros(0, np.float32), index, *squares, np.zeros((0, 9)), index)


@vector_kernel
def apply_free(inverse, right, out):
    """Write A_ff^-1 right to the first rows of ``out``, for three right-hand sides (f, 3), flat."""
    solve_free(inverse, (0,), right.reshape((1, -1)), out.reshape((1, -1)))


@vector_kernel
def solve_kept(kept, right, out):
    """Write the solution for each row of ``right`` (k, 3 f + q) to the same row of ``out`` (k, 3 f + q)."""
    count, frames, turned = len(kept.frames), kept.frames, right.copy()
    for k in range(len(right)):
        for i in range(count):
            r0, r1, r2 = right[k, 3 * i], right[k, 3 * i + 1], right[k, 3 * i + 2]
            for j in range(3):
                turned[k, 3 * i + j] = frames[i, j] * r0 + frames[i, 3 + j] * r1 + frames[i, 6 + j] * r2
    solve_unturned(kept, turned, out)
    for k in range(len(right)):
        for i in range(count):
            r0, r1, r2 = out[k, 3 * i], out[k, 3 * i + 1], out[k, 3 * i + 2]
            for j in range(3):
                out[k, 3 * i + j] = frames[i, 3 * j] * r0 + frames[i, 3 * j + 1] * r1 + frames[i, 3 * j + 2] * r2


@vector_kernel
def solve_unturned(kept, right, out):
    """Solve as `solve_kept` does, but without the rotations since the factor was computed."""
    solve_free(kept, (0, 1, 2), right, out)
    for k in range(len(right)):
        if len(kept.schur):
            solve_rigid(kept.harmonic, kept.schur, right[k], out[k])
        if len(kept.springs):
            connect(kept.springs, kept.reach, kept.inner, out[k])
        clear_fixed(kept.fixed, out[k])


@vector_internal
def solve_rigid(harmonic, schur, right, out):
    """Write the solution of the rigid rows to ``out``, and correct the solution of the free rows in it."""
    count, rows = harmonic.shape
    force = right[count : count + rows].copy()
    for i in range(count):
        for j in range(rows):
            force[j] -= harmonic[i, j] * right[i]
    for i in range(rows):
        total = 0.0
        for j in range(rows):
            total += schur[i, j] * force[j]
        out[count + i] = total
    for i in range(count):
        for j in range(rows):
            out[i] -= harmonic[i, j] * out[count + j]


@vector_internal
def connect(springs, reach, inner, out):
    """Correct ``out``, a solution without springs, for the effect of the springs."""
    count = len(springs)
    lengths = np.empty(count)
    for k in range(count):
        total = 0.0
        for i in range(len(out)):
            total += springs[k, i] * out[i]
        lengths[k] = total
    for k in range(count):
        force = 0.0
        for j in range(count):
            force += inner[k, j] * lengths[j]
        for i in range(len(out)):
            out[i] -= force * reach[k, i]


@vector_internal
def solve_free(factor, axes, right, out):
    """Write the solution for each row of ``right`` (k, 3 f) of the free vertices to ``out`` (k, 3 f).

    The factor has as many rows for each vertex as ``axes`` has numbers: three, or one for x, y and z alike.
    """
    order, size = factor.order, len(axes)
    width = 3 // size
    x = np.empty((width * len(right), size * len(order)))
    for k in range(len(right)):
        for i in range(len(order)):
            for axis in range(3):
                x[width * k + axis // size, size * i + axis % size] = right[k, 3 * order[i] + axis]
    solve_ordered(factor.values, factor.plan, axes, x, np.empty((width, size * len(order))))
    for k in range(len(right)):
        for i in range(len(order)):
            for axis in range(3):
                out[k, 3 * order[i] + axis] = x[width * k + axis // size, size * i + axis % size]


@vector_internal
def solve_ordered(values, plan, axes, x, local):
    """Replace each row of ``x`` (k, s f), a right-hand side in the order of elimination, by its solution.

    The factor has s rows for each vertex, as many as ``axes`` has numbers. 3 / s rows of ``x`` are solved together. All
    rows of ``x`` are processed with one supernode before the next supernode is read. In the forward substitution,
    supernodes whose own rows of ``x`` are zero are skipped. ``local`` (3 / s, w) is scratch for the rows of any
    supernode.
    """
    width, size = len(local), len(axes)
    for node in range(len(plan.first) - 1):
        at, rows = plan.value_start[node], plan.rows[plan.row_start[node] : plan.row_start[node + 1]]
        for k in range(0, len(x), width):
            if is_zero(x[k : k + width], size * plan.first[node], size * plan.first[node + 1]):
                continue
            reduce_node(values, at, rows, axes, plan.first[node], plan.first[node + 1], x[k : k + width], local)
    for node in range(len(plan.first) - 2, -1, -1):
        at, rows = plan.value_start[node], plan.rows[plan.row_start[node] : plan.row_start[node + 1]]
        for k in range(0, len(x), width):
            expand_node(values, at, rows, axes, plan.first[node], plan.first[node + 1], x[k : k + width], local)


@inlined
def is_zero(x, first, last):
    """Return whether ``x`` is zero in the columns from ``first`` up to ``last``."""
    for k in range(len(x)):
        for n in range(first, last):
            if x[k, n] != 0.0:
                return False
    return True


@inlined
def reduce_node(values, at, rows, axes, first, last, x, local):
    """Solve U^T y = x in the rows of a supernode, and subtract the products from its other rows."""
    size, own = len(axes), last - first  # the size is a constant of the compiled code
    for k in range(len(x)):
        copy_part(local[k], 0, x[k], size * first, size * own)
        clear_part(local[k], size * own, size * (len(rows) - own))
    if size == 3:
        reduce_rows(values, at, local[0], size * len(rows), size * own)
    else:
        reduce_three(values, at, local[0], local[1], local[2], len(rows), own)
    for k in range(len(x)):
        copy_part(x[k], size * first, local[k], 0, size * own)
        for n in range(own, len(rows)):
            for i in range(size):
                x[k, size * rows[n] + i] += local[k, size * n + i]


@inlined
def expand_node(values, at, rows, axes, first, last, x, local):
    """Solve U y = x in the rows of a supernode; the solution in its other rows is known."""
    size, own = len(axes), last - first
    for k in range(len(x)):
        copy_part(local[k], 0, x[k], size * first, size * own)
        for n in range(own, len(rows)):
            for i in range(size):
                local[k, size * n + i] = x[k, size * rows[n] + i]
    if size == 3:
        expand_rows(values, at, local[0], size * len(rows), size * own)
    else:
        expand_three(values, at, local[0], local[1], local[2], len(rows), own)
    for k in range(len(x)):
        copy_part(x[k], size * first, local[k], 0, size * own)


GROUP = 8
"""Number of columns of Y that are computed together."""


@kernel
def reduce_columns(values, plan, used, x, local):
    """Replace each row y of ``x`` (k, 3 f), in the order of elimination, by the solution of U^T y = x.

    ``used`` (s,) marks the supernodes on the paths from the columns' rows to the root; ``local`` is scratch.
    """
    for node in range(len(plan.first) - 1):
        if used[node]:
            at, rows = plan.value_start[node], plan.rows[plan.row_start[node] : plan.row_start[node + 1]]
            for k in range(len(x)):
                reduce_node(values, at, rows, (0, 1, 2), plan.first[node], plan.first[node + 1], x[k : k + 1], local)


@kernel
def multiply_columns(new, every, out):
    """Add the products (n, k) of the columns of ``new`` (3 f, n) and of ``every`` (3 f, k) to ``out``.

    The last n columns of ``every`` are ``new``. In the products of ``new`` with itself, entries below the diagonal may
    be left out.
    """
    count, known = new.shape[1], every.shape[1] - new.shape[1]
    for left in range(0, every.shape[1], TILE):
        right = min(left + TILE, every.shape[1])
        some = count if left < known else min(count, right - known)
        for first in range(0, len(every), PANEL):
            add_products(every, new, first, min(first + PANEL, len(every)), left, right, some, out)


@internal
def add_products(every, new, first, last, left, right, some, out):
    """Add products in the rows from ``first`` up to ``last``, three or six, to a part of ``out``.

    The part has ``some`` rows, and the columns from ``left`` up to ``right``.
    """
    full = last - first == PANEL
    beside = first + 3 if full else first
    a, b, c = every[first, left:right], every[first + 1, left:right], every[first + 2, left:right]
    d, e, f = every[beside, left:right], every[beside + 1, left:right], every[beside + 2, left:right]
    for i in range(some):
        row, p, q, r = out[i, left:right], new[first, i], new[first + 1, i], new[first + 2, i]
        s, t, u = (new[first + 3, i], new[first + 4, i], new[first + 5, i]) if full else (0.0, 0.0, 0.0)
        for j in range(uint64(right - left)):
            row[j] += p * a[j] + q * b[j] + r * c[j] + s * d[j] + t * e[j] + u * f[j]
