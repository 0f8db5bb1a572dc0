# SPDX-License-Identifier: Apache-2.0
"""Entries of an inverse K^-1 = Y^T Y from columns of Y = U^-T, where K = U^T U is a kept factor.

A column of Y costs half of a solution or less: the forward substitution, in the supernodes on the path from its row to
the root of the elimination tree. The operations of each entry, and their order, do not depend on what else is found
with it.
"""

from __future__ import annotations

from numpy import uint64

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.solver.matrix.substitution import PANEL

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
