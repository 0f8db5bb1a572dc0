# SPDX-License-Identifier: Apache-2.0
"""Compiled solutions with a kept sparse factor K = U^T U: forward and backward, supernode by supernode.

Six rows of the factor (two vertices) are processed at a time. Inner loops count in unsigned numbers: a possibly
negative index would cost a test in each iteration and prevent SIMD.

Two corrections follow, if a body needs them. First, handles with a free axis have rigid rows in addition to the rows of
the factor. Their Schur complement S is dense. Second, springs of lengths and volumes add G^T G to K, which would fill
the factor. With W = K^-1 G^T, the solution x without springs becomes x - W (1 + G W)^-1 G x (Sherman, Morrison and
Woodbury).

Entries of the inverse K^-1 = Y^T Y come from columns of Y = U^-T. A column of Y costs half of a solution or less: the
forward substitution, in the supernodes on the path from its row to the root of the elimination tree. The operations of
each entry, and their order, do not depend on what else is found with it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import uint64
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, internal, kernel, vector_internal, vector_kernel
from gdfe_ros.solver.matrix.unknowns import clear_fixed
from gdfe_ros.solver.vectors import clear_part, copy_part

PANEL = 6
"""Rows of the factor that are eliminated, or solved, together: two vertices."""


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


class Kept(NamedTuple):
    """A factor for the kernels, with q rigid rows and m springs.

    Attributes:
        plan: the index arrays.
        values: entries of the factor, in single or double precision; the next factorisation overwrites them.
        order: (f,) vertices in the order of their elimination.
        x, local: scratch.
        harmonic: (3 f, q) displacement of the free vertices that each rigid row causes, times -1.
        schur: (q, q) inverse of the Schur complement S.
        springs: (m, 3 f + q) rows G.
        reach: (m, 3 f + q) rows of W^T.
        inner: (m, m) inverse of 1 + G W.
        frames: (f, 9) rotations of the vertices since the factor was taken; the factor follows them.
        turned: (3 f + q,) scratch.
        fixed: (k,) int64 components that are constant (`Unknowns.fixed`); the factor does not couple them to others.
    """

    plan: Plan
    values: NDArray[np.floating]
    order: NDArray[np.int64]
    x: NDArray[np.float64]
    local: NDArray[np.float64]
    harmonic: NDArray[np.float64]
    schur: NDArray[np.float64]
    springs: NDArray[np.float64]
    reach: NDArray[np.float64]
    inner: NDArray[np.float64]
    frames: NDArray[np.float64]
    turned: NDArray[np.float64]
    fixed: NDArray[np.int64]

    @classmethod
    def none(cls, rows: int) -> Kept:
        """Return an empty factor, in place of which the constant matrix preconditions ``rows`` unknowns."""
        index, real, squares = np.zeros(0, np.int64), np.zeros(0), [np.zeros((0, 0))] * 5
        values, frames, turned = np.zeros(0, np.float32), np.zeros((0, 9)), np.zeros(rows)
        return cls(Plan(*[index] * 9), values, index, real, real, *squares, frames, turned, index)


@vector_kernel
def solve_kept(kept, right, out):
    """Write the solution for the right-hand side ``right`` (3 f + q,) to ``out`` (3 f + q,)."""
    count, frames, turned = len(kept.frames), kept.frames, kept.turned
    for i in range(count):
        r0, r1, r2 = right[3 * i], right[3 * i + 1], right[3 * i + 2]
        for j in range(3):
            turned[3 * i + j] = frames[i, j] * r0 + frames[i, 3 + j] * r1 + frames[i, 6 + j] * r2
    for i in range(3 * count, len(right)):
        turned[i] = right[i]
    solve_unturned(kept, turned, out)
    for i in range(count):
        r0, r1, r2 = out[3 * i], out[3 * i + 1], out[3 * i + 2]
        for j in range(3):
            out[3 * i + j] = frames[i, 3 * j] * r0 + frames[i, 3 * j + 1] * r1 + frames[i, 3 * j + 2] * r2


@vector_kernel
def solve_unturned(kept, right, out):
    """Solve as `solve_kept` does, but without the rotations since the factor was taken."""
    solve_free(kept, right, out)
    if len(kept.schur):
        solve_rigid(kept.harmonic, kept.schur, right, out)
    if len(kept.springs):
        connect(kept.springs, kept.reach, kept.inner, out)
    clear_fixed(kept.fixed, out)


@vector_kernel
def solve_columns(kept, right, out):
    """Do `solve_unturned` for each row of ``right`` (k, 3 f + q)."""
    for k in range(len(right)):
        solve_unturned(kept, right[k], out[k])


@vector_internal
def solve_rigid(harmonic, schur, right, out):
    """Solve for the rigid rows, and correct the solution ``out`` of the free rows."""
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
def solve_free(kept, right, out):
    """Write K^-1 ``right`` (3 f,) of the free vertices to ``out`` (3 f,)."""
    plan, values, x, local = kept.plan, kept.values, kept.x, kept.local
    for i in range(len(kept.order)):
        for axis in range(3):
            x[3 * i + axis] = right[3 * kept.order[i] + axis]
    reduce_all(values, plan, x, local)
    expand_all(values, plan, x, local)
    for i in range(len(kept.order)):
        for axis in range(3):
            out[3 * kept.order[i] + axis] = x[3 * i + axis]


@vector_internal
def reduce_all(values, plan, x, local):
    """Replace ``x`` by the solution y of U^T y = x, first row first; ``local`` is scratch for any supernode's rows."""
    for node in range(len(plan.first) - 1):
        begin, end = plan.row_start[node], plan.row_start[node + 1]
        width, own = 3 * (end - begin), 3 * (plan.first[node + 1] - plan.first[node])
        start = 3 * plan.first[node]
        copy_part(local, 0, x, start, own)
        clear_part(local, own, width - own)
        reduce_rows(values, plan.value_start[node], local, width, own)
        copy_part(x, start, local, 0, own)
        for k in range(own // 3, end - begin):
            row = 3 * plan.rows[begin + k]
            for i in range(3):
                x[row + i] += local[3 * k + i]


@vector_internal
def expand_all(values, plan, x, local):
    """Replace ``x`` by the solution y of U y = x, last row first; ``local`` is scratch for any supernode's rows."""
    for node in range(len(plan.first) - 2, -1, -1):
        begin, end = plan.row_start[node], plan.row_start[node + 1]
        width, own = 3 * (end - begin), 3 * (plan.first[node + 1] - plan.first[node])
        start = 3 * plan.first[node]
        copy_part(local, 0, x, start, own)
        for k in range(own // 3, end - begin):
            row = 3 * plan.rows[begin + k]
            for i in range(3):
                local[3 * k + i] = x[row + i]
        expand_rows(values, plan.value_start[node], local, width, own)
        copy_part(x, start, local, 0, own)


@vector_internal
def reduce_rows(values, at, local, width, own):
    """Solve the first ``own`` rows of a supernode with U^T, and subtract their products from its other rows."""
    for first in range(0, own, PANEL):
        last = min(first + PANEL, own)
        rows = values[at + first * width : at + last * width]
        for i in range(first, last):
            total = local[i]
            for k in range(first, i):
                total -= rows[(k - first) * width + i] * local[k]
            local[i] = total * rows[(i - first) * width + i]
        p, q, r, n = local[first], local[first + 1], local[first + 2], uint64(width)
        if last - first == PANEL:
            s, t, u = local[first + 3], local[first + 4], local[first + 5]
            for j in range(uint64(last), n):
                k = j + n
                total = p * rows[j] + q * rows[k]
                k += n
                total += r * rows[k]
                k += n
                total += s * rows[k]
                k += n
                total += t * rows[k]
                local[j] -= total + u * rows[k + n]
        else:
            for j in range(uint64(last), n):
                local[j] -= p * rows[j] + q * rows[j + n] + r * rows[j + n + n]


@vector_internal
def expand_rows(values, at, local, width, own):
    """Solve the first ``own`` rows of a supernode with U; the solution in its other rows is known."""
    for first in range((own - 1) // PANEL * PANEL, -1, -PANEL):
        last, none, n = min(first + PANEL, own), local.dtype.type(0.0), uint64(width)
        rows = values[at + first * width : at + last * width]
        p, q, r, s, t, u = none, none, none, none, none, none
        if last - first == PANEL:
            for j in range(uint64(last), n):
                k, known = j + n, local[j]
                p += rows[j] * known
                q += rows[k] * known
                k += n
                r += rows[k] * known
                k += n
                s += rows[k] * known
                k += n
                t += rows[k] * known
                u += rows[k + n] * known
            local[first + 3] -= s
            local[first + 4] -= t
            local[first + 5] -= u
        else:
            for j in range(uint64(last), n):
                known = local[j]
                p += rows[j] * known
                q += rows[j + n] * known
                r += rows[j + n + n] * known
        local[first] -= p
        local[first + 1] -= q
        local[first + 2] -= r
        for i in range(last - 1, first - 1, -1):
            total = local[i]
            for k in range(i + 1, last):
                total -= rows[(i - first) * width + k] * local[k]
            local[i] = total * rows[(i - first) * width + i]


GROUP = 8
"""Number of columns of Y that are found together."""
TILE = 512
"""Number of rows of a supernode that are processed together; six rows of the factor stay in the fastest cache."""
WIDE, HIGH = 256, 128
"""Columns and rows of a product that are computed together."""


@kernel
def reduce_columns(values, plan, used, x, local):
    """Replace each row y of ``x`` (`GROUP`, 3 f), in the order of elimination, by the solution of U^T y = x.

    ``used`` (s,) marks the supernodes on the paths to the root; ``local`` (`GROUP`, w) is scratch for the rows of any
    supernode.
    """
    for node in range(len(plan.first) - 1):
        if not used[node]:
            continue
        begin, own = plan.row_start[node], 3 * (plan.first[node + 1] - plan.first[node])
        width, start = 3 * (plan.row_start[node + 1] - begin), 3 * plan.first[node]
        local[:, :own], local[:, own:width] = x[:, start : start + own], 0.0
        for first in range(0, own, PANEL):
            last, at = min(first + PANEL, own), plan.value_start[node] + first * width
            for y in local:
                for i in range(first, last):
                    total = y[i]
                    for k in range(first, i):
                        total -= values[at + (k - first) * width + i] * y[k]
                    y[i] = total * values[at + (i - first) * width + i]
            for left in range(last, width, TILE):
                subtract_rows(values[at : at + (last - first) * width], width, local, first, left)
        x[:, start : start + own] = local[:, :own]
        for k in range(GROUP):
            y, sums = local[k], x[k]
            for n in range(own // 3, width // 3):
                row = 3 * plan.rows[begin + n]
                for i in range(3):
                    sums[row + i] += y[3 * n + i]


@internal
def subtract_rows(rows, width, local, first, left):
    """Subtract three or six ``rows`` of a supernode from a tile of the columns ``local``, two columns at a time."""
    full, right = len(rows) == PANEL * width, min(left + TILE, width)
    a, b, c = rows[left:right], rows[width + left : width + right], rows[2 * width + left : 2 * width + right]
    beside = 3 * width if full else 0  # three rows are read twice, the second time with factors of zero
    d, e = rows[beside + left : beside + right], rows[beside + width + left : beside + width + right]
    f = rows[beside + 2 * width + left : beside + 2 * width + right]
    for k in range(0, GROUP, 2):
        tile, low = local[k, left:right], local[k + 1, left:right]
        p, q, r, s, t, u = factors(local[k], first, full)
        p2, q2, r2, s2, t2, u2 = factors(local[k + 1], first, full)
        for j in range(uint64(right - left)):
            v, w, x, y, z, o = a[j], b[j], c[j], d[j], e[j], f[j]
            tile[j] -= p * v + q * w + r * x + s * y + t * z + u * o
            low[j] -= p2 * v + q2 * w + r2 * x + s2 * y + t2 * z + u2 * o


@inlined
def factors(y, first, full):
    """Return six numbers of ``y`` from ``first`` on; the last three are zero if not ``full``."""
    if not full:
        return y[first], y[first + 1], y[first + 2], 0.0, 0.0, 0.0
    return y[first], y[first + 1], y[first + 2], y[first + 3], y[first + 4], y[first + 5]


@kernel
def multiply_columns(new, every, used, out):
    """Subtract the products (n, k) of the columns of ``new`` (3 f, n) and of ``every`` (3 f, k) from ``out``.

    Rows outside of the ranges ``used`` (u, 2) are zero in ``new``.
    """
    for left in range(0, every.shape[1], WIDE):
        right = min(left + WIDE, every.shape[1])
        for begin, end in used:
            for first in range(begin, end, PANEL):
                subtract_products(every, new, first, min(first + PANEL, end), left, right, out)


@internal
def subtract_products(every, new, first, last, left, right, out):
    """Subtract the products of three or six rows, from ``first`` up to ``last``, from some columns of ``out``."""
    full = last - first == PANEL
    beside = first + 3 if full else first
    a, b, c = every[first, left:right], every[first + 1, left:right], every[first + 2, left:right]
    d, e, f = every[beside, left:right], every[beside + 1, left:right], every[beside + 2, left:right]
    for i in range(new.shape[1]):
        row, p, q, r = out[i, left:right], new[first, i], new[first + 1, i], new[first + 2, i]
        s, t, u = (new[first + 3, i], new[first + 4, i], new[first + 5, i]) if full else (0.0, 0.0, 0.0)
        for j in range(uint64(right - left)):
            row[j] -= p * a[j] + q * b[j] + r * c[j] + s * d[j] + t * e[j] + u * f[j]
