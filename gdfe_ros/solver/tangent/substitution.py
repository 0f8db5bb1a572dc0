# SPDX-License-Identifier: Apache-2.0
"""Compiled solutions with a kept sparse factor K = U^T U: forward and backward, supernode by supernode.

Three rows of the factor (one vertex) are processed at a time. Inner loops count in unsigned numbers: a possibly
negative index would cost a test in each iteration and prevent SIMD.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import uint64
from numpy.typing import NDArray

from gdfe_ros.compiled import vector_kernel


class Plan(NamedTuple):
    """Index arrays of the kernels: see `Elimination`.

    Attributes:
        first, row_start, rows, inside: of the elimination.
        children, child_start: (c,) and (s + 1,), of each supernode.
        part_start: (s + 1,) offset of each supernode's blocks of the matrix.
        value_start: (s + 1,) offset of each supernode's rows of the factor.
    """

    first: NDArray[np.int64]
    row_start: NDArray[np.int64]
    rows: NDArray[np.int64]
    inside: NDArray[np.int64]
    children: NDArray[np.int64]
    child_start: NDArray[np.int64]
    part_start: NDArray[np.int64]
    value_start: NDArray[np.int64]


class Kept(NamedTuple):
    """A factor for the kernels.

    Attributes:
        plan: the index arrays.
        values: of the factor, overwritten by the next one.
        order: (f,) of the vertices.
        x, local: scratch.
    """

    plan: Plan
    values: NDArray[np.float64]
    order: NDArray[np.int64]
    x: NDArray[np.float64]
    local: NDArray[np.float64]


@vector_kernel
def solve_kept(kept, right, out):
    """Write K^-1 right (3 f,) to ``out`` (3 f,)."""
    plan, values, x, local = kept.plan, kept.values, kept.x, kept.local
    for i in range(len(kept.order)):
        for axis in range(3):
            x[3 * i + axis] = right[3 * kept.order[i] + axis]
    reduce_all(values, plan, x, local)
    expand_all(values, plan, x, local)
    for i in range(len(kept.order)):
        for axis in range(3):
            out[3 * kept.order[i] + axis] = x[3 * i + axis]


@vector_kernel
def reduce_all(values, plan, x, local):
    """Solve U^T x = x in the order of elimination; ``local`` is scratch for the rows of any supernode."""
    for node in range(len(plan.first) - 1):
        begin, end = plan.row_start[node], plan.row_start[node + 1]
        width, own = 3 * (end - begin), 3 * (plan.first[node + 1] - plan.first[node])
        start = 3 * plan.first[node]
        local[:own] = x[start : start + own]
        local[own:width] = 0.0
        reduce_rows(values, plan.value_start[node], local, width, own)
        x[start : start + own] = local[:own]
        for k in range(own // 3, end - begin):
            row = 3 * plan.rows[begin + k]
            for i in range(3):
                x[row + i] += local[3 * k + i]


@vector_kernel
def expand_all(values, plan, x, local):
    """Solve U x = x in the order of elimination."""
    for node in range(len(plan.first) - 2, -1, -1):
        begin, end = plan.row_start[node], plan.row_start[node + 1]
        width, own = 3 * (end - begin), 3 * (plan.first[node + 1] - plan.first[node])
        start = 3 * plan.first[node]
        local[:own] = x[start : start + own]
        for k in range(own // 3, end - begin):
            row = 3 * plan.rows[begin + k]
            for i in range(3):
                local[3 * k + i] = x[row + i]
        expand_rows(values, plan.value_start[node], local, width, own)
        x[start : start + own] = local[:own]


@vector_kernel
def reduce_rows(values, at, local, width, own):
    """Solve the first ``own`` rows of U^T, and subtract their products from the other rows."""
    for first in range(0, own, 3):
        a = values[at + first * width : at + (first + 1) * width]
        b = values[at + (first + 1) * width : at + (first + 2) * width]
        c = values[at + (first + 2) * width : at + (first + 3) * width]
        p = local[first] * a[first]
        q = (local[first + 1] - a[first + 1] * p) * b[first + 1]
        r = (local[first + 2] - a[first + 2] * p - b[first + 2] * q) * c[first + 2]
        local[first], local[first + 1], local[first + 2] = p, q, r
        for j in range(uint64(first + 3), uint64(width)):
            local[j] -= p * a[j] + q * b[j] + r * c[j]


@vector_kernel
def expand_rows(values, at, local, width, own):
    """Solve the first ``own`` rows of U; the other rows are known."""
    for first in range(own - 3, -1, -3):
        a = values[at + first * width : at + (first + 1) * width]
        b = values[at + (first + 1) * width : at + (first + 2) * width]
        c = values[at + (first + 2) * width : at + (first + 3) * width]
        p, q, r = 0.0, 0.0, 0.0
        for j in range(uint64(first + 3), uint64(width)):
            p += a[j] * local[j]
            q += b[j] * local[j]
            r += c[j] * local[j]
        r = (local[first + 2] - r) * c[first + 2]
        q = (local[first + 1] - q - b[first + 2] * r) * b[first + 1]
        p = (local[first] - p - a[first + 1] * q - a[first + 2] * r) * a[first]
        local[first], local[first + 1], local[first + 2] = p, q, r
