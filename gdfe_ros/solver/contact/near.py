# SPDX-License-Identifier: Apache-2.0
"""Pairs of boxes that come near each other: the first part of all searches of self-contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.compiled import inlined, kernel

Ragged = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Rows of different lengths: the offsets (m + 1,) of each row, and the values of all rows, ascending in each row."""


def incidence(cells: NDArray[np.int32], count: int) -> sparse.csr_matrix:
    """Return a sparse matrix (m, n) with ones for the vertices of each cell (m, c)."""
    rows = np.repeat(np.arange(len(cells)), cells.shape[1])
    return sparse.csr_matrix((np.ones(cells.size, np.int32), (rows, cells.ravel())), shape=(len(cells), count))


def ragged(rows: sparse.csr_matrix) -> Ragged:
    """Return the columns in each of m rows."""
    return rows.indptr.astype(np.int64), rows.indices.astype(np.int64)


@kernel
def boxes_around(x, groups):
    """Return the bounds (k, 2, 3) [m] of ``groups`` (k, c) of points at ``x`` (n, 3) [m]."""
    boxes = np.empty((len(groups), 2, 3))
    for k in range(len(groups)):
        for axis in range(3):
            low, high = np.inf, -np.inf
            for point in groups[k]:
                low, high = min(low, x[point, axis]), max(high, x[point, axis])
            boxes[k, 0, axis], boxes[k, 1, axis] = low, high
    return boxes


def find_near(
    boxes: NDArray[np.float64], others: NDArray[np.float64], groups: NDArray[np.int32], kin: Ragged, within: float
) -> NDArray[np.int64]:
    """Return the pairs (2, p) of ``boxes`` and ``others`` that come within a distance [m] along each axis.

    The second numbers ascend. A pair is left out if a point of the first one is in the row of ``kin`` for the other.

    Args:
        boxes: (k, 2, 3) [m] bounds, finite.
        others: (m, 2, 3) [m] other bounds, finite.
        groups: (k, c) points in each of the first boxes.
        kin: for each of ``others``, points that belong to it.
        within: [m] distance.
    """
    if not len(boxes) or not len(others):
        return np.zeros((2, 0), np.int64)
    around, axis = others + np.array([[-within], [within]]), int(np.ptp(boxes[:, 0], axis=0).argmax())
    order = np.argsort(boxes[:, 0, axis], kind="stable")
    lows, longest = boxes[order, 0, axis], float(np.ptp(boxes[:, :, axis], axis=1).max())
    first = np.searchsorted(lows, around[:, 0, axis] - longest)
    last = np.searchsorted(lows, around[:, 1, axis], side="right")
    return meeting(boxes[order], around, groups[order], kin, order, first, last)


@kernel
def meeting(boxes, around, groups, kin, order, first, last):
    """Return the pairs (2, p) of boxes (k, 2, 3) and (m, 2, 3) that meet; see `find_near`.

    Those that may meet box j of the second ones are the first ones from ``first[j]`` to ``last[j]``. Their numbers in
    the pairs are in ``order`` (k,).
    """
    found, count = np.empty((2, len(order)), np.int64), 0
    for j in range(len(around)):
        for i in range(first[j], last[j]):
            if miss(boxes, i, around, j, 0) or miss(boxes, i, around, j, 1) or miss(boxes, i, around, j, 2):
                continue
            own = False
            for point in groups[i]:
                own |= among(kin, j, point)
            if own:
                continue
            if count == found.shape[1]:
                found = np.concatenate((found, found), axis=1)
            found[0, count], found[1, count] = order[i], j
            count += 1
    return found[:, :count].copy()


@inlined
def miss(boxes, i, around, j, axis):
    """Return whether two boxes do not meet along an axis."""
    return boxes[i, 0, axis] > around[j, 1, axis] or boxes[i, 1, axis] < around[j, 0, axis]


@inlined
def among(rows, row, value):
    """Return whether a row of a `Ragged` list contains a value, by bisection."""
    starts, values = rows
    low, high = starts[row], starts[row + 1]
    while low < high:
        middle = (low + high) // 2
        if values[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low < starts[row + 1] and values[low] == value
