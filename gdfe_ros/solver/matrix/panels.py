# SPDX-License-Identifier: Apache-2.0
"""Compiled forward and backward solutions in one supernode, several rows of the factor at a time.

Inner loops count in unsigned numbers: a possibly negative index would cost a test in each iteration and prevent SIMD.
"""

from __future__ import annotations

from numpy import uint64

from gdfe_ros.compiled import inlined, vector_inlined, vector_internal

PANEL, TAKEN = 6, 4
"""Numbers of rows of the factor that are processed together: for one right-hand side, the rows of two vertices; for
three right-hand sides, as many as fit into the registers.
"""
TILE = 256
"""Number of columns of a row that are updated at a time; six rows of this length fit into the fastest cache."""


@vector_inlined
def six(rows, j, n):
    """Return the numbers in column ``j`` of six rows of length ``n``."""
    a = j + n
    b = a + n
    c = b + n
    d = c + n
    return rows[j], rows[a], rows[b], rows[c], rows[d], rows[d + n]


@vector_inlined
def dot_six(a, b):
    """Return the inner product of two vectors of six numbers."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@vector_inlined
def add_four(sums, factor, a):
    """Return four ``sums`` plus ``factor`` times four numbers."""
    return sums[0] + factor * a[0], sums[1] + factor * a[1], sums[2] + factor * a[2], sums[3] + factor * a[3]


@vector_inlined
def add_six(sums, factor, a):
    """Return six ``sums`` plus ``factor`` times six numbers."""
    return (*add_four(sums, factor, a), sums[4] + factor * a[4], sums[5] + factor * a[5])


@inlined
def reduce_panel(rows, width, first, last, local):
    """Solve with the diagonal block of U^T in a supernode's rows from ``first`` up to ``last``; replace ``local``."""
    for i in range(first, last):
        total = local[i]
        for k in range(first, i):
            total -= rows[(k - first) * width + i] * local[k]
        local[i] = total * rows[(i - first) * width + i]


@inlined
def expand_panel(rows, width, first, last, local):
    """Solve with the diagonal block of U in a supernode's rows from ``first`` up to ``last``; replace ``local``."""
    for i in range(last - 1, first - 1, -1):
        total = local[i]
        for k in range(i + 1, last):
            total -= rows[(i - first) * width + k] * local[k]
        local[i] = total * rows[(i - first) * width + i]


@vector_internal
def reduce_rows(values, at, local, width, own):
    """Solve for ``local[:own]`` with a supernode's U^T, and subtract its contributions from ``local[own:]``."""
    for first in range(0, own, PANEL):
        last = min(first + PANEL, own)
        rows = values[at + first * width : at + last * width]
        reduce_panel(rows, width, first, last, local)
        n = uint64(width)
        if last - first == PANEL:
            known = six(local, first, 1)
            for j in range(uint64(last), n):
                local[j] -= dot_six(known, six(rows, j, n))
        else:
            p, q, r = local[first], local[first + 1], local[first + 2]
            for j in range(uint64(last), n):
                local[j] -= p * rows[j] + q * rows[j + n] + r * rows[j + n + n]


@vector_internal
def expand_rows(values, at, local, width, own):
    """Solve the first ``own`` rows of a supernode with U; the solution in its other rows is known."""
    for first in range((own - 1) // PANEL * PANEL, -1, -PANEL):
        last, none, n = min(first + PANEL, own), local.dtype.type(0.0), uint64(width)
        rows = values[at + first * width : at + last * width]
        sums = none, none, none, none, none, none
        if last - first == PANEL:
            for j in range(uint64(last), n):
                sums = add_six(sums, local[j], six(rows, j, n))
        else:
            for j in range(uint64(last), n):
                sums = add_six(sums, local[j], (rows[j], rows[j + n], rows[j + n + n], none, none, none))
        for i in range(first, last):
            local[i] -= sums[i - first]
        expand_panel(rows, width, first, last, local)


@inlined
def places_of(count, width):
    """Return the offsets of a panel's second, third and fourth row; for a missing row, the offset of its last row."""
    return uint64(min(1, count - 1) * width), uint64(min(2, count - 1) * width), uint64((count - 1) * width)


@inlined
def four_of(local, first, count):
    """Return four numbers of ``local`` from ``first`` on; 0 for the missing ones beyond ``count``."""
    return (
        local[first],
        local[first + 1] if count > 1 else 0.0,
        local[first + 2] if count > 2 else 0.0,
        local[first + 3] if count > 3 else 0.0,
    )


@vector_internal
def reduce_three(values, at, u, v, w, width, own):
    """Do `reduce_rows` for three right-hand sides ``u``, ``v`` and ``w``."""
    for first in range(0, own, TAKEN):
        last = min(first + TAKEN, own)
        rows, (b, c, d) = values[at + first * width : at + last * width], places_of(last - first, width)
        for local in (u, v, w):
            reduce_panel(rows, width, first, last, local)
        u0, u1, u2, u3 = four_of(u, first, last - first)
        v0, v1, v2, v3 = four_of(v, first, last - first)
        w0, w1, w2, w3 = four_of(w, first, last - first)
        for j in range(uint64(last), uint64(width)):
            p, q, r, s = rows[j], rows[j + b], rows[j + c], rows[j + d]
            u[j] -= u0 * p + u1 * q + u2 * r + u3 * s
            v[j] -= v0 * p + v1 * q + v2 * r + v3 * s
            w[j] -= w0 * p + w1 * q + w2 * r + w3 * s


@vector_internal
def expand_three(values, at, u, v, w, width, own):
    """Do `expand_rows` for three right-hand sides ``u``, ``v`` and ``w``."""
    for first in range((own - 1) // TAKEN * TAKEN, -1, -TAKEN):
        last, none = min(first + TAKEN, own), u.dtype.type(0.0)
        rows, (b, c, d) = values[at + first * width : at + last * width], places_of(last - first, width)
        sums = none, none, none, none
        of_u, of_v, of_w = sums, sums, sums
        for j in range(uint64(last), uint64(width)):
            taken = rows[j], rows[j + b], rows[j + c], rows[j + d]
            of_u, of_v, of_w = add_four(of_u, u[j], taken), add_four(of_v, v[j], taken), add_four(of_w, w[j], taken)
        for local, taken in ((u, of_u), (v, of_v), (w, of_w)):
            for i in range(first, last):
                local[i] -= taken[i - first]
            expand_panel(rows, width, first, last, local)
