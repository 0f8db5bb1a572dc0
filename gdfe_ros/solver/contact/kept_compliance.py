# SPDX-License-Identifier: Apache-2.0
"""Compliance W = J H J^T of the contact points that take part in a step, with what is kept from step to step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.contact.compliance import add_history, join
from gdfe_ros.solver.contact.field import PointField
from gdfe_ros.solver.contact.kept_columns import ConstantColumns, HalvedColumns, KeptColumns
from gdfe_ros.solver.descent.loop import Metric
from gdfe_ros.solver.descent.workspace import MEMORY, Problem, Workspace


class Numbered(NamedTuple):
    """Rows of unknowns on which points depend, and their columns.

    Attributes:
        kept: the columns of the inverse matrix, which are known for these rows.
        field, chosen: the points, and the indices (c,) of those that take part.
        every: (c, e) the rows of each point, filled up with -1.
        rows: (m,) all rows, ascending.
        number: (r,) number of each row among them.
    """

    kept: KeptColumns
    field: PointField
    chosen: NDArray[np.int64]
    every: NDArray[np.int64]
    rows: NDArray[np.int64]
    number: NDArray[np.int64]


class Compliance:
    """Finds W, and keeps what does not change: columns of M^-1, J M^-1 J^T, and products of M^-1 with pairs of L-BFGS.

    Args:
        vertices: vertices on which contact forces can act, ascending.
        count: number 3 r of unknowns.
    """

    def __init__(self, vertices: NDArray[np.int32], count: int) -> None:
        self._vertices, self._rows = vertices, count
        self._columns: dict[str, tuple[tuple[object, ...], KeptColumns]] = {}
        self._images, self._known = np.zeros((MEMORY, count)), np.full(MEMORY, np.nan)
        self._source: tuple[object, ...] = ()
        self._matrix: tuple[object, ...] = ()
        self._joined = self._w = np.zeros((0, 0))
        self._blocks, self._frames = np.zeros(0), np.zeros((0, 9))
        self._last_rows: Numbered | None = None

    def of(
        self,
        problem: Problem,
        work: Workspace,
        metric: Metric,
        key: tuple[object, ...],
        field: PointField,
        count: int,
    ) -> NDArray[np.float64]:
        """Return W (3 c, 3 c) [m/N] of the points that take part; the next call overwrites it."""
        chosen, constant = field.chosen[:count].copy(), not len(metric.kept.order)
        kept = self._kept("constant" if constant else "tangent", problem, metric, key)
        numbered, blocks = self._number_rows(field, chosen, kept), field.blocks[chosen]
        frames = np.zeros((0, 9)) if constant else metric.kept.frames
        given, between = (chosen, field.rows, field.blocks, field.used), kept.between(numbered.rows)
        turned, matrix, source = not np.array_equal(frames, self._frames), (between,), (*key, constant)
        if turned or not (_same(matrix, self._matrix) and np.array_equal(blocks, self._blocks)):
            self._matrix, self._blocks = matrix, blocks
            if len(self._joined) != 3 * count:
                self._joined, self._w = np.empty((2, 3 * count, 3 * count))
            join(*given, numbered.number, between, frames, self._joined)
        if turned or not _same(source, self._source):
            self._known[...], self._source, self._frames = np.nan, source, frames.copy()
        self._w[...] = self._joined
        add_history(work, metric, self._images, self._known, *given, field.stencils.soft, self._w)
        return self._w

    def _number_rows(self, field: PointField, chosen: NDArray[np.int64], kept: KeptColumns) -> Numbered:
        """Return the numbered rows of the ``chosen`` points, whose columns are known then."""
        last = self._last_rows
        if last is not None and last.field is field and last.kept is kept and np.array_equal(last.chosen, chosen):
            return last
        used = np.arange(field.rows.shape[1]) < field.used[chosen, None]
        every = np.where(used, field.rows[chosen], -1)
        if last is not None and last.kept is kept and np.array_equal(last.every, every):
            rows, number = last.rows, last.number
        else:
            rows, number = np.unique(every[used]), np.full(self._rows // 3, -1, dtype=np.int64)
            number[rows] = np.arange(len(rows))
            kept.include(rows)
        self._last_rows = Numbered(kept, field, chosen, every, rows, number)
        return self._last_rows

    def _kept(self, kind: str, problem: Problem, metric: Metric, key: tuple[object, ...]) -> KeptColumns:
        """Return the kept columns of the tangent or of the constant matrix; those of an earlier matrix are dropped."""
        key = (metric.coupling.inverse_schur, problem.unknowns.free) if kind == "constant" else key
        known = self._columns.get(kind)
        if known is not None and _same(known[0], key):
            return known[1]
        if kind == "constant":
            free = problem.unknowns.free
            found = ConstantColumns(metric.coupling, np.flatnonzero(np.isin(free, self._vertices)), len(free))
        else:
            found = HalvedColumns(metric.kept)
        self._columns[kind] = key, found
        return found


def _same(one: tuple[object, ...], other: tuple[object, ...]) -> bool:
    """Return whether two keys have the same objects and equal numbers."""
    pairs = zip(one, other, strict=False)
    return len(one) == len(other) and all(a is b or (isinstance(a, float) and a == b) for a, b in pairs)
