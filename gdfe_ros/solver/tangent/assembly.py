# SPDX-License-Identifier: Apache-2.0
"""The tangent stiffness of a body's movable vertices, 3 x 3 block by block."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.matrix.unknowns import Unknowns


@kernel
def add_tangents(stiffness, slot, out):
    """Add tangents (m, 3 c, 3 c), made symmetric, to ``out`` (k, 3, 3) at ``slot`` (m, c, c); -1: nowhere."""
    for e in range(len(slot)):
        for a in range(slot.shape[1]):
            for b in range(slot.shape[1]):
                if slot[e, a, b] < 0:
                    continue
                for i in range(3):
                    for j in range(3):
                        both = stiffness[e, 3 * a + i, 3 * b + j] + stiffness[e, 3 * b + j, 3 * a + i]
                        out[slot[e, a, b], i, j] += 0.5 * both


class Assembly:
    """Where each pair of vertices stands in the matrix of the vertices that move.

    Rows are the free vertices, then those of the handles with a free axis.

    Args:
        groups: vertices (m, c) that are coupled with each other: cells, and what terms couple.
        unknowns: the numbering.

    Attributes:
        free, members: number of free vertices, and of those of handles with a free axis.
        indices, indptr: int32, of the block rows.
    """

    def __init__(self, groups: Sequence[NDArray[np.int32]], unknowns: Unknowns) -> None:
        self.free, self.members = len(unknowns.free), len(unknowns.members)
        rows = self.free + self.members
        moving = np.concatenate([unknowns.free, unknowns.members])
        number = np.full(max(int(group.max(initial=0)) for group in (*groups, moving)) + 1, -1)
        number[moving] = np.arange(rows)
        names = [_names(number[group], rows) for group in groups]
        pairs, slots = np.unique(np.concatenate(names), return_inverse=True)
        # What does not move has the name -1, which comes first where there is any.
        fixed = int(len(pairs) > 0 and pairs[0] < 0)
        ends = np.cumsum([len(name) for name in names])[:-1]
        parts = np.split((slots - fixed).astype(np.int32), ends)
        self._slots = [part.reshape(*group.shape, group.shape[1]) for part, group in zip(parts, groups, strict=True)]
        self.indices = (pairs[fixed:] % rows).astype(np.int32)
        self.indptr = np.searchsorted(pairs[fixed:] // rows, np.arange(rows + 1)).astype(np.int32)

    def blocks(self, tangents: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Sum the tangents (m, 3 c, 3 c) [N/m] of each group to blocks (k, 3, 3)."""
        out = np.zeros((len(self.indices), 3, 3))
        for tangent, slot in zip(tangents, self._slots, strict=True):
            add_tangents(tangent, slot, out)
        return out

    def spread(self, matrix: sparse.csc_matrix, unknowns: Unknowns) -> NDArray[np.float64]:
        """Return blocks (k, 3, 3) of a matrix (n, n) that acts on x, y and z alike, over the same pairs."""
        chosen = np.concatenate([unknowns.free, unknowns.members])
        part = matrix[chosen][:, chosen].tocsr()
        first = np.repeat(np.arange(len(self.indptr) - 1), np.diff(self.indptr))
        values = np.asarray(part[first, self.indices]).ravel()
        return values[:, None, None] * np.eye(3)

    def graph(self) -> sparse.csr_matrix:
        """Return an entry for every two vertices that share an element (f + b, f + b)."""
        size = self.free + self.members
        return sparse.csr_matrix((np.ones(len(self.indices)), self.indices, self.indptr), shape=(size, size))

    def matrix(self, blocks: NDArray[np.float64]) -> sparse.csr_matrix:
        """Return the matrix (3 (f + b), 3 (f + b)) of blocks (k, 3, 3)."""
        size = 3 * (self.free + self.members)
        return sparse.bsr_matrix((blocks, self.indices, self.indptr), shape=(size, size)).tocsr()


def _names(rows: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return a number for each pair of rows in a group (m, c), (m c c,); -1 where one of them does not move."""
    first, second = rows[:, :, None], rows[:, None, :]
    return np.where((first >= 0) & (second >= 0), first * count + second, -1).ravel()
