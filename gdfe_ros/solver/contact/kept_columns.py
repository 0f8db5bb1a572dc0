# SPDX-License-Identifier: Apache-2.0
"""The inverse C = M^-1 of the initial matrix between the rows of unknowns that contacts have needed so far.

C is constant as long as M is kept; its rotations are left out. What is known does not depend on the order in which rows
were asked for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.matrix.constant_matrix import Coupling
from gdfe_ros.solver.matrix.substitution import GROUP, HIGH, Kept, apply_free, multiply_columns, reduce_columns

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


class KeptColumns(ABC):
    """The columns of C that are known.

    C is K^-1 of the free rows, plus G S^-1 G^T for the rigid rows, minus W (1 + G W)^-1 W^T for springs (`Kept`).

    Args:
        count: number f of free rows.
        rigid: (3 f, q) displacements of the free rows that each rigid row causes, times -1.
        schur: (q, q) inverse of the Schur complement S of the rigid rows.
        fixed: components of rows that are constant.
    """

    def __init__(self, count: int, rigid: Array, schur: Array, fixed: Numbers) -> None:
        self._rigid, self._schur, self._fixed = rigid, schur, fixed
        self._reach, self._inner = np.zeros((0, 3 * count)), np.zeros((0, 0))
        self._slot, self._count = np.full(count, -1, dtype=np.int64), 0
        self._last: tuple[Numbers, Array] = np.zeros(0, dtype=np.int64), np.zeros((0, 0))

    def include(self, rows: Numbers) -> None:
        """Find the columns of some ``rows`` that are not known yet."""
        rows = rows[rows < len(self._slot)]
        new = self._ordered(np.unique(rows[self._slot[rows] < 0]))
        if len(new):
            first, self._count = self._count, self._count + len(new)
            self._slot[new] = np.arange(first, self._count)
            self._find(new, first)

    def between(self, rows: Numbers) -> Array:
        """Return C (3 m, 3 m) between known ``rows`` (m,), ascending; the caller must not modify it."""
        if np.array_equal(rows, self._last[0]):
            return self._last[1]
        known, entries = rows[rows < len(self._slot)], _entries(rows)
        found, count = np.zeros((len(entries), len(entries))), 3 * len(known)
        found[:count, :count] = self._blocks(known)
        if len(self._schur):
            rigid = np.zeros((len(entries), len(self._schur)))
            rigid[:count] = self._rigid[entries[:count]]
            rigid[range(count, len(entries)), entries[count:] - 3 * len(self._slot)] = -1.0
            found += _projected(rigid, self._schur)
        if len(self._inner):
            found -= _projected(self._reach[:, entries].T, self._inner)
        constant = np.isin(entries, self._fixed)
        found[constant], found[:, constant] = 0.0, 0.0
        self._last = rows, found
        return found

    def _ordered(self, rows: Numbers) -> Numbers:
        """Return the order in which to find ``rows``."""
        return rows

    @abstractmethod
    def _find(self, new: Numbers, first: int) -> None:
        """Find the columns of ``new`` rows, which get the places from ``first`` on."""

    @abstractmethod
    def _blocks(self, rows: Numbers) -> Array:
        """Return K^-1 (3 m, 3 m) between free ``rows`` (m,), ascending."""


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
        self._place = np.full(count, -1, dtype=np.int64)
        self._place[rows] = np.arange(len(rows))
        self._columns = np.zeros((0, len(rows)))

    def _find(self, new: Numbers, first: int) -> None:
        if self._count > len(self._columns):
            self._columns = np.concatenate([self._columns, np.zeros((self._count, len(self._needed)))])
        out = np.empty((len(self._slot), 3))
        for begin in range(0, len(new), 3):
            three = new[begin : begin + 3]
            right = np.zeros_like(out)
            right[three, range(len(three))] = 1.0
            apply_free(self._inverse, right.reshape(-1), out.reshape(-1))
            self._columns[first + begin : first + begin + len(three)] = out[self._needed, : len(three)].T

    def _blocks(self, rows: Numbers) -> Array:
        found = np.tril(self._columns[self._slot[rows]][:, self._place[rows]])
        return np.kron(found + np.tril(found, -1).T, np.eye(3))


class HalvedColumns(KeptColumns):
    """Columns of Y = U^-T of a kept factor K = U^T U, and their products.

    Args:
        kept: the factor; its values must not change.
    """

    def __init__(self, kept: Kept) -> None:
        plan, count = kept.plan, len(kept.order)
        super().__init__(count, kept.harmonic, kept.schur, kept.fixed)
        self._kept, self._place = kept, np.empty(count, dtype=np.int64)
        self._reach, self._inner = kept.reach, kept.inner
        self._place[kept.order] = np.arange(count)
        self._owner = np.repeat(np.arange(len(plan.parent)), np.diff(plan.first))
        self._halves, self._products = np.zeros((3 * count, 0)), np.zeros((0, 0))
        self._scratch = np.empty((GROUP, 3 * int(np.diff(plan.row_start).max(initial=0))))

    def _ordered(self, rows: Numbers) -> Numbers:
        return rows[np.argsort(self._place[rows])]  # neighbours share paths

    def _find(self, new: Numbers, first: int) -> None:
        self._make_room()
        entries = _entries(self._place[new])
        for begin in range(0, len(entries), HIGH):
            self._add(entries[begin : begin + HIGH], 3 * first + begin)

    def _blocks(self, rows: Numbers) -> Array:
        slots = _entries(self._slot[rows])
        return self._products[np.ix_(slots, slots)]

    def _make_room(self) -> None:
        """Enlarge the arrays for the rows that are counted."""
        need, have = 3 * self._count, len(self._products)
        if need <= have:
            return
        size = max(need, 3 * have // 2)
        halves, products = np.zeros((len(self._halves), size)), np.zeros((size, size))
        halves[:, :have], products[:have, :have] = self._halves, self._products
        self._halves, self._products = halves, products

    def _add(self, entries: Numbers, begin: int) -> None:
        """Find the columns of some ``entries`` (n,) of the factor, the next from ``begin`` on, and their products."""
        kept, end = self._kept, begin + len(entries)
        used = np.zeros(len(kept.plan.parent), dtype=np.bool_)
        for first in range(0, len(entries), GROUP):
            group = entries[first : first + GROUP]
            x, path = np.zeros((GROUP, len(self._halves))), np.zeros_like(used)
            x[range(len(group)), group] = 1.0
            for node in np.unique(self._owner[group // 3]):
                while node >= 0 and not path[node]:
                    path[node], node = True, kept.plan.parent[node]
            reduce_columns(kept.values, kept.plan, path, x, self._scratch)
            self._halves[:, begin + first : begin + first + len(group)] = x[: len(group)].T
            used |= path
        starts, products = 3 * kept.plan.first, np.zeros((len(entries), end))
        ranges = np.stack([starts[:-1][used], starts[1:][used]], axis=1)
        new = np.ascontiguousarray(self._halves[:, begin:end])
        multiply_columns(new, self._halves[:, :end], ranges, products)
        self._products[begin:end, :end], self._products[:end, begin:end] = -products, -products.T


def _entries(rows: Numbers) -> Numbers:
    """Return the three components of each of ``rows`` (m,)."""
    return (3 * rows[:, None] + np.arange(3)).ravel()


def _projected(columns: Array, inner: Array) -> Array:
    """Return B C B^T (k, k), symmetric to the bit, for B = ``columns`` (k, q) and C = ``inner`` (q, q)."""
    found = np.einsum("ka,la->kl", np.einsum("ka,ab->kb", columns, inner), columns)
    return 0.5 * (found + found.T)
