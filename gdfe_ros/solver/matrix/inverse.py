# SPDX-License-Identifier: Apache-2.0
"""Compiled application of the constant matrix' inverse: explicit, or by the supernodes of a factor U^T U.

Three right-hand sides are solved at once, so that each entry of the factor is read once for x, y and z. Rows of the
factor are processed four at a time; rows of zeros fill the last four. The length of each row is a multiple of eight
numbers, and entries up to the diagonal and beyond a row's end are zero. Inner loops use unsigned indices: a possibly
negative index would cost a test in each iteration and prevent SIMD.

A large factor does not fit into any cache, and reading it dominates the time of a solve. Its entries are rounded to
16-bit fractions of the largest entry of their row, and the solve is in single precision.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange
from numpy import uint64
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, parallel_kernel, vector_internal, vector_kernel

TAKEN, LINE = 4, 8
"""Number of rows that are processed at a time, and divisor of each row's length."""


class Inverse(NamedTuple):
    """An inverse (f, f) for the kernels; it is never modified, so that threads may use it together.

    Attributes:
        explicit: (f, f) the inverse itself, or (0, 0).
        order, first, row_start, rows: attributes of the factor's `Elimination`; empty without a factor.
        group_start: (g + 1,) first supernode of each group. Groups are independent of each other; the supernodes after
            them depend on several groups.
        length: (s,) length of the rows of each supernode.
        value_start: (s + 1,) offset of each supernode's values.
        pivot: (f,) inverse of each row's diagonal entry.
        scale: (f,) number by which each row's other entries are multiplied.
        values: other entries of all rows, and a row of zeros at the end. Empty if ``coarse`` is used.
        coarse: these entries as 16-bit integers; empty if they are in double precision.
    """

    explicit: NDArray[np.float64]
    order: NDArray[np.int64]
    first: NDArray[np.int64]
    row_start: NDArray[np.int64]
    rows: NDArray[np.int64]
    group_start: NDArray[np.int64]
    length: NDArray[np.int64]
    value_start: NDArray[np.int64]
    pivot: NDArray[np.float64]
    scale: NDArray[np.float64]
    values: NDArray[np.float64]
    coarse: NDArray[np.int16]

    @classmethod
    def of(cls, explicit: NDArray[np.float64] | None = None) -> Inverse:
        """Return an explicit inverse (f, f); an empty inverse for None, if a library solves with the matrix."""
        start, none = np.zeros(1, np.int64), np.zeros(0, np.int64)
        known = np.zeros((0, 0)) if explicit is None else explicit
        no_value, no_code = np.zeros(0), np.zeros(0, np.int16)
        return cls(known, none, start, start, none, start, none, start, no_value, no_value, no_value, no_code)


@vector_kernel
def apply_free(inverse, right, out, threads):
    """Write A_ff^-1 right to the first rows of ``out``, for three right-hand sides (f, 3), flat.

    The result does not depend on the number of ``threads``, bit by bit. None stands for one thread; the parallel
    version is then not compiled.
    """
    if len(inverse.order) == 0:
        apply_explicit(inverse.explicit, right, out)
        return
    if len(inverse.coarse) > 0:
        apply_factor(inverse, inverse.coarse, np.empty(3 * len(inverse.order), np.float32), right, out, threads)
    else:
        apply_factor(inverse, inverse.values, np.empty(3 * len(inverse.order)), right, out, threads)


@vector_internal
def apply_factor(inverse, values, x, right, out, threads):
    """Do `apply_free` with the factor's ``values``, in the precision of the scratch ``x`` (f, 3), flat."""
    for i in range(len(inverse.order)):
        for axis in range(3):
            x[3 * i + axis] = right[3 * inverse.order[i] + axis]
    solve_rows(inverse, values, x, threads)
    for i in range(len(inverse.order)):
        for axis in range(3):
            out[3 * inverse.order[i] + axis] = x[3 * i + axis]


@vector_internal
def apply_explicit(explicit, right, out):
    """Write the product of an explicit inverse and ``right`` (f, 3), flat, to ``out``."""
    for i in range(len(explicit)):
        for axis in range(3):
            out[3 * i + axis] = 0.0
        for j in range(len(explicit)):
            weight = explicit[i, j]
            out[3 * i] += weight * right[3 * j]
            out[3 * i + 1] += weight * right[3 * j + 1]
            out[3 * i + 2] += weight * right[3 * j + 2]


@vector_internal
def solve_rows(inverse, values, x, threads):
    """Replace ``x`` (f, 3), flat and in the order of elimination, by (U^T U)^-1 x.

    The forward solution begins, and the backward solution ends, with the independent groups.
    """
    groups = len(inverse.group_start) - 1
    begin, end = inverse.group_start[groups], len(inverse.length)
    above = x[3 * inverse.first[begin] :]
    taken = np.zeros((groups, len(above)), x.dtype)
    if threads is None or groups == 0:
        reduce_groups(inverse, values, x, taken, 0, groups)
    else:
        reduce_in_threads(threads, inverse, values, x, taken)
    for group in range(groups):
        for i in range(len(above)):
            above[i] += taken[group, i]
    reduce_nodes(inverse, values, x, above, begin, end)
    expand_nodes(inverse, values, x, begin, end)
    if threads is None or groups == 0:
        expand_nodes(inverse, values, x, 0, begin)
    else:
        expand_in_threads(threads, inverse, values, x)


@internal
def reduce_groups(inverse, values, x, taken, first, last):
    """Replace ``x`` by U^-T x in some groups; add contributions to later supernodes to ``taken`` (g, 3 k)."""
    for group in range(first, last):
        reduce_nodes(inverse, values, x, taken[group], inverse.group_start[group], inverse.group_start[group + 1])


@parallel_kernel
def reduce_in_threads(threads, inverse, values, x, taken):
    """Do `reduce_groups` for all groups, distributed among threads."""
    groups = len(inverse.group_start) - 1
    for part in prange(threads):
        reduce_groups(inverse, values, x, taken, part * groups // threads, (part + 1) * groups // threads)


@parallel_kernel
def expand_in_threads(threads, inverse, values, x):
    """Do `expand_nodes` for all groups, distributed among threads."""
    groups = len(inverse.group_start) - 1
    for part in prange(threads):
        first, last = part * groups // threads, (part + 1) * groups // threads
        expand_nodes(inverse, values, x, inverse.group_start[first], inverse.group_start[last])


@vector_internal
def reduce_nodes(inverse, values, x, above, begin, end):
    """Replace ``x`` by U^-T x in supernodes ``begin`` to ``end``; ``above`` are the rows after those of all groups."""
    longest = inverse.length.max()
    local, blank = np.empty(3 * longest, x.dtype), len(values) - longest
    top = inverse.first[inverse.group_start[-1]]
    for node in range(begin, end):
        start, length = inverse.first[node], inverse.length[node]
        rows = inverse.rows[inverse.row_start[node] : inverse.row_start[node + 1]]
        own = inverse.first[node + 1] - start
        u, v, w = local[:length], local[length : 2 * length], local[2 * length : 3 * length]
        for k in range(own):
            u[k], v[k], w[k] = x[3 * (start + k)], x[3 * (start + k) + 1], x[3 * (start + k) + 2]
        for k in range(own, length):
            u[k], v[k], w[k] = 0.0, 0.0, 0.0
        pivots, scales = inverse.pivot[start : start + own], inverse.scale[start : start + own]
        reduce_rows(values, inverse.value_start[node], blank, pivots, scales, u, v, w, own)
        for k in range(own):
            x[3 * (start + k)], x[3 * (start + k) + 1], x[3 * (start + k) + 2] = u[k], v[k], w[k]
        for k in range(own, len(rows)):
            target, row = (above, 3 * (rows[k] - top)) if rows[k] >= top else (x, 3 * rows[k])
            target[row] += u[k]
            target[row + 1] += v[k]
            target[row + 2] += w[k]


@vector_internal
def expand_nodes(inverse, values, x, begin, end):
    """Replace ``x`` by U^-1 x in the supernodes ``begin`` to ``end``, the last supernode first."""
    longest = inverse.length.max()
    local, blank = np.empty(3 * longest, x.dtype), len(values) - longest
    for node in range(end - 1, begin - 1, -1):
        start, length = inverse.first[node], inverse.length[node]
        rows = inverse.rows[inverse.row_start[node] : inverse.row_start[node + 1]]
        own, height = inverse.first[node + 1] - start, len(rows)
        u, v, w = local[:length], local[length : 2 * length], local[2 * length : 3 * length]
        for k in range(height):
            u[k], v[k], w[k] = x[3 * rows[k]], x[3 * rows[k] + 1], x[3 * rows[k] + 2]
        for k in range(height, length):
            u[k], v[k], w[k] = 0.0, 0.0, 0.0
        pivots, scales = inverse.pivot[start : start + own], inverse.scale[start : start + own]
        expand_rows(values, inverse.value_start[node], blank, pivots, scales, u, v, w, own)
        for k in range(own):
            x[3 * (start + k)], x[3 * (start + k) + 1], x[3 * (start + k) + 2] = u[k], v[k], w[k]


@vector_internal
def row_of(values, at, blank, length, number, own):
    """Return row ``number`` of a supernode with ``own`` rows; a row of zeros if there is no such row."""
    begin = at + number * length if number < own else blank
    return values[begin : begin + length]


@vector_internal
def four_of(u, first):
    """Return four successive numbers of ``u``."""
    return u[first], u[first + 1], u[first + 2], u[first + 3]


@vector_internal
def number_as(u, numbers, at):
    """Return number ``at``, in the precision of ``u``; 0 if there is no such number."""
    return u.dtype.type(numbers[at] if at < len(numbers) else 0.0)


@vector_internal
def four_as(u, numbers, first):
    """Return `number_as` of four successive numbers."""
    one, two = number_as(u, numbers, first), number_as(u, numbers, first + 1)
    return one, two, number_as(u, numbers, first + 2), number_as(u, numbers, first + 3)


@vector_internal
def product(p, q):
    """Return the products of four and four numbers."""
    return p[0] * q[0], p[1] * q[1], p[2] * q[2], p[3] * q[3]


@vector_internal
def forward(u, first, a, b, c, d, pivot, scale):
    """Solve four rows of U^T for one axis; return the four values."""
    p = u[first] * pivot[0]
    pa = p * scale[0]
    q = (u[first + 1] - a[first + 1] * pa) * pivot[1]
    qb = q * scale[1]
    r = (u[first + 2] - a[first + 2] * pa - b[first + 2] * qb) * pivot[2]
    rc = r * scale[2]
    s = (u[first + 3] - a[first + 3] * pa - b[first + 3] * qb - c[first + 3] * rc) * pivot[3]
    return p, q, r, s


@vector_internal
def backward(right, taken, first, a, b, c, pivot, scale):
    """Solve four rows of U for one axis; ``taken`` are the products of their entries and the values after them."""
    s = (right[3] - scale[3] * taken[3]) * pivot[3]
    r = (right[2] - scale[2] * (taken[2] + c[first + 3] * s)) * pivot[2]
    q = (right[1] - scale[1] * (taken[1] + b[first + 3] * s + b[first + 2] * r)) * pivot[1]
    p = (right[0] - scale[0] * (taken[0] + a[first + 3] * s + a[first + 2] * r + a[first + 1] * q)) * pivot[0]
    return p, q, r, s


@vector_internal
def put(found, u, first, own):
    """Write four successive numbers to ``u``, except numbers after the supernode's ``own`` rows."""
    p, q, r, s = found
    u[first] = p
    if first + 1 < own:
        u[first + 1] = q
    if first + 2 < own:
        u[first + 2] = r
    if first + 3 < own:
        u[first + 3] = s


@vector_internal
def reduce_rows(values, at, blank, pivots, scales, u, v, w, own):
    """Solve the ``own`` rows of U^T of a supernode, and subtract the products from the supernode's other rows."""
    length = len(u)
    for first in range(0, own, TAKEN):
        a, b = row_of(values, at, blank, length, first, own), row_of(values, at, blank, length, first + 1, own)
        c, d = row_of(values, at, blank, length, first + 2, own), row_of(values, at, blank, length, first + 3, own)
        pivot, scale = four_as(u, pivots, first), four_as(u, scales, first)
        x = forward(u, first, a, b, c, d, pivot, scale)
        y = forward(v, first, a, b, c, d, pivot, scale)
        z = forward(w, first, a, b, c, d, pivot, scale)
        x0, x1, x2, x3 = product(x, scale)
        y0, y1, y2, y3 = product(y, scale)
        z0, z1, z2, z3 = product(z, scale)
        for j in range(uint64(first // LINE * LINE), uint64(length)):
            u[j] -= x0 * a[j] + x1 * b[j] + x2 * c[j] + x3 * d[j]
            v[j] -= y0 * a[j] + y1 * b[j] + y2 * c[j] + y3 * d[j]
            w[j] -= z0 * a[j] + z1 * b[j] + z2 * c[j] + z3 * d[j]
        put(x, u, first, own)
        put(y, v, first, own)
        put(z, w, first, own)


@vector_internal
def expand_rows(values, at, blank, pivots, scales, u, v, w, own):
    """Solve the ``own`` rows of U of a supernode; the values of its other rows are known."""
    length, zero = len(u), u.dtype.type(0.0)
    for first in range((own - 1) // TAKEN * TAKEN, -1, -TAKEN):
        a, b = row_of(values, at, blank, length, first, own), row_of(values, at, blank, length, first + 1, own)
        c, d = row_of(values, at, blank, length, first + 2, own), row_of(values, at, blank, length, first + 3, own)
        x, y, z = four_of(u, first), four_of(v, first), four_of(w, first)
        nothing = (zero, zero, zero, zero)
        put(nothing, u, first, own)
        put(nothing, v, first, own)
        put(nothing, w, first, own)
        x0, x1, x2, x3 = nothing
        y0, y1, y2, y3 = nothing
        z0, z1, z2, z3 = nothing
        for j in range(uint64(first // LINE * LINE), uint64(length)):
            x0 += a[j] * u[j]
            y0 += a[j] * v[j]
            z0 += a[j] * w[j]
            x1 += b[j] * u[j]
            y1 += b[j] * v[j]
            z1 += b[j] * w[j]
            x2 += c[j] * u[j]
            y2 += c[j] * v[j]
            z2 += c[j] * w[j]
            x3 += d[j] * u[j]
            y3 += d[j] * v[j]
            z3 += d[j] * w[j]
        pivot, scale = four_as(u, pivots, first), four_as(u, scales, first)
        put(backward(x, (x0, x1, x2, x3), first, a, b, c, pivot, scale), u, first, own)
        put(backward(y, (y0, y1, y2, y3), first, a, b, c, pivot, scale), v, first, own)
        put(backward(z, (z0, z1, z2, z3), first, a, b, c, pivot, scale), w, first, own)
