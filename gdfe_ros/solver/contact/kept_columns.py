# SPDX-License-Identifier: Apache-2.0
"""Entries of C between the rows of unknowns that contacts have needed so far.

C is the inverse of the initial matrix M without the rotations of vertices. It is constant as long as M is kept. The
computed entries do not depend on the order in which rows were requested.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.matrix.constant_matrix import Coupling
from gdfe_ros.solver.matrix.substitution import GROUP, Kept, apply_free, multiply_columns, reduce_columns

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


@kernel
def add_projected(columns, inner, first, sign, out):
    """Add B C B^T times ``sign`` to ``out``, exactly symmetric, for B = ``columns`` (k, q) and C = ``inner`` (q, q).

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


@kernel
def add_entries(values, rows, columns, out):
    """Add ``values`` (n, k) to the entries of ``out`` in ``rows`` (n,) and ``columns`` (k,)."""
    for i in range(len(rows)):
        for j in range(len(columns)):
            out[rows[i], columns[j]] += values[i, j]


class KeptColumns(ABC):
    """The part of C between all rows that have been requested.

    C is K^-1 of the free rows, plus H S^-1 H^T for the rigid rows, minus W (1 + G W)^-1 W^T for springs (`Kept`).

    Args:
        count: number f of free rows.
        rigid: (3 f, q) matrix H: displacements of the free rows that each rigid row causes, times -1.
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
        """Compute the entries of C for those of ``rows`` that are not known yet."""
        new = np.unique(rows[self.place[rows] < 0])
        if not len(new):
            return
        free, first = self._order(new[new < self._count]), len(self._rows)
        self._rows = np.concatenate([self._rows, free, new[new >= self._count]])
        self.place[self._rows[first:]] = np.arange(first, len(self._rows))
        self.between = enlarge(self.between, 3 * len(self._rows))
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
        """Return free ``rows`` in the order in which their entries are computed."""
        return rows

    @abstractmethod
    def _find(self, new: Numbers, first: int) -> None:
        """Write the entries of K^-1 between all known rows and ``new`` free rows to `between`.

        The places of the new rows begin with ``first``.
        """


class ConstantColumns(KeptColumns):
    """Columns of the constant matrix' inverse. It acts on x, y and z alike, so that one solution gives three columns.

    Rounding makes the columns slightly unsymmetric. The entry between two rows is therefore always taken from the
    column of the later row.

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

    A column has entries only in the supernodes on the path from its row to the root of the elimination tree. For each
    supernode, the parts of all columns whose paths contain it are stored.

    Args:
        kept: the factor; its values must not change.
    """

    def __init__(self, kept: Kept) -> None:
        plan, count = kept.plan, len(kept.order)
        super().__init__(count, kept.harmonic, kept.schur, kept.fixed)
        self._kept, self._number = kept, np.empty(count, dtype=np.int64)
        self._reach, self._inner = kept.reach, kept.inner
        self._number[kept.order] = np.arange(count)
        self._node, self._starts = np.repeat(np.arange(len(plan.parent)), np.diff(plan.first)), 3 * plan.first
        self._parts: dict[int, tuple[Numbers, Array]] = {}
        self._scratch = np.empty((GROUP, 3 * int(np.diff(plan.row_start).max(initial=0))))

    def _order(self, rows: Numbers) -> Numbers:
        return rows[np.argsort(self._number[rows])]  # neighbours share paths

    def _find(self, new: Numbers, first: int) -> None:
        entries, size, found = _entries(self._number[new]), 3 * len(self._rows), {}
        for begin in range(0, len(entries), GROUP):
            group = entries[begin : begin + GROUP]
            columns = 3 * first + begin + np.arange(len(group))
            for node, part in self._halve(group):
                found.setdefault(node, []).append((columns, part))
        for node in sorted(found):
            columns, parts = (np.concatenate(each, axis=-1) for each in zip(*found[node], strict=True))
            known, others = self._parts.get(node, (columns[:0], parts[:, :0]))
            self._parts[node] = every = np.concatenate([known, columns]), np.concatenate([others, parts], axis=1)
            products = np.zeros((len(columns), len(every[0])))
            multiply_columns(parts, every[1], products)
            add_entries(products, columns, every[0], self.between)
        own = self.between[3 * first : size, 3 * first : size]
        own[...] = np.triu(own) + np.triu(own, 1).T
        self.between[: 3 * first, 3 * first : size] = self.between[3 * first : size, : 3 * first].T

    def _halve(self, entries: Numbers) -> Iterator[tuple[int, Array]]:
        """Yield each supernode on the paths of ``entries`` (at most `GROUP`), and its rows (k, n) of their columns."""
        kept, path = self._kept, np.zeros(len(self._kept.plan.parent), dtype=np.bool_)
        for node in np.unique(self._node[entries // 3]):
            while node >= 0 and not path[node]:
                path[node], node = True, kept.plan.parent[node]
        x = np.zeros((len(entries), self._starts[-1]))
        x[range(len(entries)), entries] = 1.0
        reduce_columns(kept.values, kept.plan, path, x, self._scratch)
        for node in np.flatnonzero(path).tolist():
            yield node, x[:, self._starts[node] : self._starts[node + 1]].T.copy()


def _entries(rows: Numbers) -> Numbers:
    """Return the three components of each of ``rows`` (m,)."""
    return (3 * rows[:, None] + np.arange(3)).ravel()


def enlarge(array: Array, size: int) -> Array:
    """Return ``array`` (p, p) with zeros after its entries, so that both axes have ``size`` or more."""
    have = len(array)
    if size <= have:
        return array
    found = np.zeros((max(size, 3 * have // 2),) * 2)
    found[:have, :have] = array
    return found
