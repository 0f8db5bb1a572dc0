# SPDX-License-Identifier: Apache-2.0
"""Compliance W = J H J^T of the contact points that take part in a step, with what is kept from step to step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.contact.compliance import add_history, join
from gdfe_ros.solver.contact.field import PointField
from gdfe_ros.solver.contact.kept_columns import ConstantColumns, HalvedColumns, KeptColumns
from gdfe_ros.solver.descent.loop import Metric
from gdfe_ros.solver.descent.workspace import MEMORY, Problem, Workspace, numbers


class Compliance:
    """Finds W, and keeps what does not change: columns of M^-1, J M^-1 J^T, and products of M^-1 with pairs of L-BFGS.

    Args:
        vertices: vertices on which contact forces can act, ascending.
        count: number 3 r of unknowns.
    """

    def __init__(self, vertices: NDArray[np.int32], count: int) -> None:
        self._vertices, self._every = vertices, np.zeros((0, 0), dtype=np.int64)
        self._rows, self._number = self._every.ravel(), np.full(count // 3, -1, dtype=np.int64)
        self._images, self._known = np.zeros((MEMORY, count)), np.full(MEMORY, np.nan)
        self._source: tuple[object, ...] = ()
        self._columns: KeptColumns
        self._between: NDArray[np.float64] | None = None
        self._joined = self._w = np.zeros((0, 0))
        self._blocks, self._frames, self._scale = np.zeros(0), np.zeros((0, 9)), 1.0

    def of(
        self, problem: Problem, work: Workspace, metric: Metric, key: tuple[object, ...], field: PointField, count: int
    ) -> NDArray[np.float64]:
        """Return W (3 c, 3 c) [m/N] of the points that take part; the next call overwrites it."""
        chosen = field.chosen[:count].copy()
        self._take_matrix(problem, work, metric, key)
        self._number_rows(field, chosen)
        self._columns.include(self._rows)
        blocks, between = field.blocks[chosen], self._columns.between(self._rows)
        given = chosen, field.rows, field.blocks, field.used
        if between is not self._between or not np.array_equal(blocks, self._blocks):
            self._between, self._blocks = between, blocks
            if len(self._joined) != 3 * count:
                self._joined, self._w = np.empty((2, 3 * count, 3 * count))
            join(*given, self._number, between, self._frames, self._joined)
            if self._scale != 1.0:
                self._joined *= self._scale
        self._w[...] = self._joined
        add_history(work, metric, self._images, self._known, *given, field.stencils.soft, self._w)
        return self._w

    def _take_matrix(self, problem: Problem, work: Workspace, metric: Metric, key: tuple[object, ...]) -> None:
        """Drop what belongs to another initial matrix than the present one, or to other rotations of the vertices.

        ``key`` has the arrays of the tangent; the constant matrix is known by its own.
        """
        status, free = numbers(work), problem.unknowns.free
        wild = bool(status["wild"])
        constant, scale = wild or not len(metric.kept.order), float(status["scale"]) if wild else 1.0
        frames = np.zeros((0, 9)) if constant else metric.kept.frames
        source = (metric.coupling.inverse_schur, free) if constant else key
        if len(source) != len(self._source) or any(a is not b for a, b in zip(source, self._source, strict=True)):
            needed = np.flatnonzero(np.isin(free, self._vertices))
            columns = ConstantColumns(metric.coupling, needed, len(free)) if constant else HalvedColumns(metric.kept)
            self._source, self._columns = source, columns
        elif scale == self._scale and np.array_equal(frames, self._frames):
            return
        self._known[...], self._between, self._frames, self._scale = np.nan, None, frames.copy(), scale

    def _number_rows(self, field: PointField, chosen: NDArray[np.int64]) -> None:
        """Find all rows of unknowns on which the ``chosen`` points depend, ascending, and the number of each."""
        every = np.where(np.arange(field.rows.shape[1]) < field.used[chosen, None], field.rows[chosen], -1)
        if not np.array_equal(every, self._every):
            self._every, self._rows, self._between = every, np.unique(every[every >= 0]), None
            self._number[self._rows] = np.arange(len(self._rows))
