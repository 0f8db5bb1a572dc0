# SPDX-License-Identifier: Apache-2.0
"""Pairs of boxes that are near each other: the first part of all searches of self-contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.mesh.triples import along, corner, dot, minus

Pairs = TypeVar("Pairs")

MOST = 25
"""Largest number of bins along an axis."""
Ragged = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Rows of different lengths: the offsets (m + 1,) of each row, and the values of all rows, ascending in each row."""


def incidence(cells: NDArray[np.int32], count: int) -> sparse.csr_matrix:
    """Return a sparse matrix (m, n) with ones for the vertices of each cell (m, c)."""
    rows = np.repeat(np.arange(len(cells)), cells.shape[1])
    return sparse.csr_matrix((np.ones(cells.size, np.int32), (rows, cells.ravel())), shape=(len(cells), count))


def make_ragged(rows: sparse.csr_matrix) -> Ragged:
    """Return the column indices of the entries in each of m rows."""
    return rows.indptr.astype(np.int64), rows.indices.astype(np.int64)


class KeptPairs:
    """Pairs from a search within a distance plus a margin. The search is repeated only after larger motions.

    Args:
        find: function of positions (n, 3) [m] and a distance [m] that returns the pairs within it.
        points: (k,) points whose motion relative to their mean motion decides whether the search is repeated.
        margin: [m] by which the search distance exceeds the requested distance.
        none: the pairs if positions are not finite.
    """

    WIDE = 2.0
    """The search is repeated, too, if the distance of the last search exceeds that of a new search by this factor."""

    def __init__(
        self,
        find: Callable[[NDArray[np.float64], float], Pairs],
        points: NDArray[np.int32],
        margin: float,
        none: Pairs,
    ) -> None:
        self._find, self._points, self._margin, self._none = find, points, margin, none
        self._within, self._searched, self._found = -np.inf, np.zeros((0, 3)), none

    def within(self, x: NDArray[np.float64], reach: float) -> Pairs:
        """Return all pairs within the distance ``reach`` [m] at positions ``x`` (n, 3) [m], and perhaps others."""
        known = np.isfinite(self._within) and self._within <= self.WIDE * (reach + self._margin)
        if not (known and reach + 2.0 * relative_motion(x, self._searched, self._points) <= self._within):
            sound = bool(np.isfinite(x).all())
            self._within, self._searched = reach + self._margin if sound else -np.inf, x.copy()
            self._found = self._find(x, self._within) if sound else self._none
        return self._found


@kernel
def relative_motion(x, before, points):
    """Return the largest displacement [m] of the ``points`` (k,) from ``before`` to ``x``, relative to the mean."""
    mean, longest = (0.0, 0.0, 0.0), 0.0
    for p in points:
        mean = along(1.0, mean, 1.0 / len(points), minus(corner(x, p), corner(before, p)))
    for p in points:
        moved = minus(minus(corner(x, p), corner(before, p)), mean)
        longest = max(longest, dot(moved, moved)) if dot(moved, moved) >= 0.0 else math.inf
    return math.sqrt(longest)


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


@kernel
def find_near(boxes, others, groups, kin, within):
    """Return the pairs (2, p) of ``boxes`` and ``others`` that are within a distance [m] along each axis.

    The indices of ``others`` ascend. A pair is left out if a point of its first box is in the row of ``kin`` for its
    other box. The first boxes are sorted into the bins of a grid by their least corners.

    Args:
        boxes: (k, 2, 3) [m] bounds, finite.
        others: (m, 2, 3) [m] other bounds, finite.
        groups: (k, c) points in each of the first boxes.
        kin: for each of ``others``, points that belong to it.
        within: [m] distance.
    """
    found, count, least, longest, pitch, counts = np.empty((2, len(boxes) + 1), np.int64), 0, *lay_grid(boxes, others)
    order, starts = sort_into_bins(boxes, least, pitch, counts)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for j in range(len(others) if len(boxes) else 0):
        for axis in range(3):
            begin, end = others[j, 0, axis] - within - longest[axis], others[j, 1, axis] + within
            low[axis] = bin_of(begin, least[axis], pitch[axis], counts[axis])
            high[axis] = bin_of(end, least[axis], pitch[axis], counts[axis])
        for a in range(low[0], high[0] + 1):
            for b in range(low[1], high[1] + 1):
                row = (a * counts[1] + b) * counts[2]
                for place in range(starts[row + low[2]], starts[row + high[2] + 1]):
                    i = order[place]
                    if miss(boxes, i, others, j, within) or has_kin(groups[i], kin, j):
                        continue
                    if count == found.shape[1]:
                        found = np.concatenate((found, found), axis=1)
                    found[0, count], found[1, count] = i, j
                    count += 1
    return found[:, :count].copy()


@internal
def lay_grid(boxes, others):
    """Return a grid of bins: least corner (3,), longest edges of ``boxes`` (3,), bin edges (3,), bin counts (3,)."""
    least, most, longest = np.full(3, np.inf), np.full(3, -np.inf), np.zeros(3)
    pitch, counts = np.ones(3), np.ones(3, np.int64)
    for axis in range(3):
        for i in range(len(boxes)):
            low, high = boxes[i, 0, axis], boxes[i, 1, axis]
            least[axis], most[axis] = min(least[axis], low), max(most[axis], low)
            longest[axis] = max(longest[axis], high - low)
        wide = longest[axis]
        for j in range(len(others)):
            wide += (others[j, 1, axis] - others[j, 0, axis]) / len(others)
        span = most[axis] - least[axis]
        if 0.0 < span < np.inf:
            counts[axis] = min(1 + int(span / max(wide, span / MOST)), MOST)
            pitch[axis] = span / counts[axis]
    return least, longest, pitch, counts


@inlined
def bin_of(x, least, pitch, count):
    """Return the bin along an axis that contains a coordinate; beyond the grid, the first or the last bin."""
    return int(min(max((x - least) / pitch, 0.0), count - 1.0))


@internal
def sort_into_bins(boxes, least, pitch, counts):
    """Return the numbers of ``boxes``, bin by bin, and the offset of each bin in them."""
    bins, starts = np.empty(len(boxes), np.int64), np.zeros(counts[0] * counts[1] * counts[2] + 1, np.int64)
    for i in range(len(boxes)):
        number = 0
        for axis in range(3):
            number = number * counts[axis] + bin_of(boxes[i, 0, axis], least[axis], pitch[axis], counts[axis])
        bins[i] = number
        starts[number + 1] += 1
    for number in range(len(starts) - 1):
        starts[number + 1] += starts[number]
    order, following = np.empty(len(boxes), np.int64), starts.copy()
    for i in range(len(boxes)):
        order[following[bins[i]]] = i
        following[bins[i]] += 1
    return order, starts


@inlined
def miss(boxes, i, others, j, within):
    """Return whether two boxes are farther than ``within`` [m] from each other along an axis."""
    apart = False
    for axis in range(3):
        apart |= boxes[i, 0, axis] > others[j, 1, axis] + within or boxes[i, 1, axis] < others[j, 0, axis] - within
    return apart


@inlined
def has_kin(group, kin, j):
    """Return whether a point of a ``group`` is in row ``j`` of a `Ragged` list."""
    own = False
    for point in group:
        own |= among(kin, j, point)
    return own


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
