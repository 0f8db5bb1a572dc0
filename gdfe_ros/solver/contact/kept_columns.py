# SPDX-License-Identifier: Apache-2.0
"""The inverse C = M^-1 of the initial matrix between the rows of unknowns that contacts have needed so far.

C is constant as long as M is kept; its rotations are left out. What is known does not depend on the order in which rows
were asked for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.matrix.constant_matrix import Coupling
from gdfe_ros.solver.matrix.substitution import GROUP, HIGH, Kept, apply_free, multiply_columns, reduce_columns

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


@kernel
def add_projected(columns, inner, first, sign, out):
    """Add B C B^T times ``sign`` to ``out`` for B = ``columns`` (k, q) and C = ``inner`` (q, q), symmetric to the bit.

    Entries between two rows before ``first`` stay as they are. No entry depends on the order of rows.
    """
    count, width = columns.shape
    half = np.zeros((count, width))
    for a in range(count):
        for i in range(width):
            for j in range(width):
                half[a, j] += columns[a, i] * inner[i, j]
    for a in range(first, count):
        for b in range(a + 1):
            one, other = 0.0, 0.0
            for i in range(width):
                one, other = one + half[a, i] * columns[b, i], other + half[b, i] * columns[a, i]
            out[a, b] += 0.5 * sign * (one + other)
            out[b, a] = out[a, b]


class KeptColumns(ABC):
    """The part of C between the rows that are known.

    C is K^-1 of the free rows, plus G S^-1 G^T for the rigid rows, minus W (1 + G W)^-1 W^T for springs (`Kept`).

    Args:
        count: number f of free rows.
        rigid: (3 f, q) displacements of the free rows that each rigid row causes, times -1.
        schur: (q, q) inverse of the Schur complement S of the rigid rows.
        fixed: components of rows that are constant.

    Attributes:
        place: (r,) place of each row in `between`; -1 for a row that is not known.
        between: (3 m, 3 m) C between at least the known rows.
    """

    def __init__(self, count: int, rigid: Array, schur: Array, fixed: Numbers) -> None:
        self._count, self._rigid, self._schur, self._fixed = count, rigid, schur, fixed
        self._reach, self._inner = np.zeros((0, 3 * count)), np.zeros((0, 0))
        self.place = np.full(count + len(schur) // 3, -1, dtype=np.int64)
        self._rows, self.between = np.zeros(0, dtype=np.int64), np.zeros((0, 0))

    def include(self, rows: Numbers) -> None:
        """Find what is not known yet of some ``rows``."""
        new = np.unique(rows[self.place[rows] < 0])
        if not len(new):
            return
        free, first = self._order(new[new < self._count]), len(self._rows)
        self._rows = np.concatenate([self._rows, free, new[new >= self._count]])
        self.place[self._rows[first:]] = np.arange(first, len(self._rows))
        self.between = enlarge(self.between, 3 * len(self._rows), 2)
        self._find(free, first)
        entries, rigid = _entries(self._rows), np.zeros((3 * len(self._rows), len(self._schur)))
        own = entries < 3 * self._count
        rigid[own] = self._rigid[entries[own]]
        rigid[~own, entries[~own] - 3 * self._count] = -1.0
        add_projected(rigid, self._schur, 3 * first, 1.0, self.between)
        if len(self._inner):
            add_projected(np.ascontiguousarray(self._reach[:, entries].T), self._inner, 3 * first, -1.0, self.between)
        constant = np.flatnonzero(np.isin(entries, self._fixed))
        self.between[constant], self.between[:, constant] = 0.0, 0.0

    def _order(self, rows: Numbers) -> Numbers:
        """Return the order in which to find free ``rows``."""
        return rows

    @abstractmethod
    def _find(self, new: Numbers, first: int) -> None:
        """Write K^-1 between all known rows and ``new`` free ones, whose places begin with ``first``, to `between`."""


class ConstantColumns(KeptColumns):
    """Columns of the constant matrix' inverse, which is the same for x, y and z: one solution finds three.

    Of two rows, the entry between them is taken from the column of the later one: rounding makes it unsymmetric.

    Args:
        coupling: the inverse of the free block, and the coupling of the rigid rows.
        rows: the free rows, ascending, that any contact may need.
        count: number of free rows.
    """

    def __init__(self, coupling: Coupling, rows: Numbers, count: int) -> None:
        super().__init__(count, coupling.harmonic, coupling.inverse_schur, coupling.fixed)
        self._inverse, self._needed = coupling.inverse, rows
        self._column = np.full(count + len(coupling.inverse_schur) // 3, -1, dtype=np.int64)
        self._column[rows] = np.arange(len(rows))
        self._columns = np.zeros((0, len(rows) + 1))  # the last one is 0: that of rigid rows

    def _find(self, new: Numbers, first: int) -> None:
        found, out = np.zeros((len(self._rows) - first, len(self._needed) + 1)), np.empty((self._count, 3))
        for begin in range(0, len(new), 3):
            three = new[begin : begin + 3]
            right = np.zeros_like(out)
            right[three, range(len(three))] = 1.0
            apply_free(self._inverse, right.reshape(-1), out.reshape(-1))
            found[begin : begin + len(three), :-1] = out[self._needed, : len(three)].T
        self._columns = np.concatenate([self._columns, found])
        both = self._columns[:, self._column[self._rows]]
        latest = np.where(self._rows[:, None] > self._rows, both, both.T)[first:]
        size = 3 * len(self._rows)
        self.between[3 * first : size, :size] = np.kron(latest, np.eye(3))
        self.between[:size, 3 * first : size] = self.between[3 * first : size, :size].T


class HalvedColumns(KeptColumns):
    """Columns of Y = U^-T of a kept factor K = U^T U, and their products.

    Args:
        kept: the factor; its values must not change.
    """

    def __init__(self, kept: Kept) -> None:
        plan, count = kept.plan, len(kept.order)
        super().__init__(count, kept.harmonic, kept.schur, kept.fixed)
        self._kept, self._number = kept, np.empty(count, dtype=np.int64)
        self._reach, self._inner = kept.reach, kept.inner
        self._number[kept.order] = np.arange(count)
        self._node = np.repeat(np.arange(len(plan.parent)), np.diff(plan.first))
        self._halves = np.zeros((3 * count, 0))
        self._scratch = np.empty((GROUP, 3 * int(np.diff(plan.row_start).max(initial=0))))

    def _order(self, rows: Numbers) -> Numbers:
        return rows[np.argsort(self._number[rows])]  # neighbours share paths

    def _find(self, new: Numbers, first: int) -> None:
        self._halves = enlarge(self._halves, 3 * len(self._rows), 1)
        entries = _entries(self._number[new])
        for begin in range(0, len(entries), HIGH):
            self._add(entries[begin : begin + HIGH], 3 * first + begin)

    def _add(self, entries: Numbers, begin: int) -> None:
        """Find the columns of some ``entries`` (n,) of the factor, the next from ``begin`` on, and their products."""
        kept, end = self._kept, begin + len(entries)
        used = np.zeros(len(kept.plan.parent), dtype=np.bool_)
        for first in range(0, len(entries), GROUP):
            group = entries[first : first + GROUP]
            x, path = np.zeros((GROUP, len(self._halves))), np.zeros_like(used)
            x[range(len(group)), group] = 1.0
            for node in np.unique(self._node[group // 3]):
                while node >= 0 and not path[node]:
                    path[node], node = True, kept.plan.parent[node]
            reduce_columns(kept.values, kept.plan, path, x, self._scratch)
            self._halves[:, begin + first : begin + first + len(group)] = x[: len(group)].T
            used |= path
        starts, products = 3 * kept.plan.first, np.zeros((len(entries), end))
        ranges = np.stack([starts[:-1][used], starts[1:][used]], axis=1)
        new = np.ascontiguousarray(self._halves[:, begin:end])
        multiply_columns(new, self._halves[:, :end], ranges, products)
        self.between[begin:end, :end], self.between[:end, begin:end] = -products, -products.T


def _entries(rows: Numbers) -> Numbers:
    """Return the three components of each of ``rows`` (m,)."""
    return (3 * rows[:, None] + np.arange(3)).ravel()


def enlarge(array: Array, size: int, axes: int) -> Array:
    """Return ``array`` (p, q) with zeros after its entries, so that the last ``axes`` axes have ``size`` or more."""
    have = array.shape[1]
    if size <= have:
        return array
    found = np.zeros((max(size, 3 * have // 2),) * 2 if axes == 2 else (len(array), max(size, 3 * have // 2)))
    found[: len(array), :have] = array
    return found
