# SPDX-License-Identifier: Apache-2.0
"""The kept tangent stiffness: its assembly in 3 x 3 blocks, one for each coupled pair of movable vertices, and springs.

A commanded cable length and a commanded chamber volume act like springs. The length of a spring is linear in small
displacements: d = a . x. A spring of stiffness k adds k a a^T to the tangent. These entries may couple any vertices,
and would fill the factor. The rows sqrt(k) a of all springs therefore form a separate matrix G. The factor contains no
springs; `substitution` corrects its solutions by G.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.matrix.unknowns import Unknowns
from gdfe_ros.solver.vectors import Array


@kernel
def add_tangents(stiffness, slot, out):
    """Add tangents (m, 3 c, 3 c), symmetrised, to the blocks ``out`` (k, 3, 3) with indices ``slot`` (m, c, c).

    Entries with the index -1 are left out.
    """
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
    """Sparsity pattern of the matrix of movable vertices.

    Rows are the free vertices, then the vertices of the handles with a free axis.

    Args:
        groups: vertices (m, c) that are coupled with each other: by cells, and by terms.
        unknowns: the numbering of the unknowns.

    Attributes:
        free, members: number f of free vertices, and number b of vertices of handles with a free axis.
        indices, indptr: int32 column of each block, and offset of each block row (compressed sparse rows).
    """

    def __init__(self, groups: Sequence[NDArray[np.int32]], unknowns: Unknowns) -> None:
        self.free, self.members = len(unknowns.free), len(unknowns.members)
        self._fixed, rows = unknowns.fixed, self.free + self.members
        moving = np.concatenate([unknowns.free, unknowns.members])
        number = np.full(max(int(group.max(initial=0)) for group in (*groups, moving)) + 1, -1)
        number[moving] = np.arange(rows)
        names = [_names(number[group], rows) for group in groups]
        pairs, slots = np.unique(np.concatenate(names), return_inverse=True)
        # Pairs with an immovable vertex have the number -1, which is sorted first.
        fixed = int(len(pairs) > 0 and pairs[0] < 0)
        ends = np.cumsum([len(name) for name in names])[:-1]
        parts = np.split((slots - fixed).astype(np.int32), ends)
        self._slots = [part.reshape(*group.shape, group.shape[1]) for part, group in zip(parts, groups, strict=True)]
        self.indices = (pairs[fixed:] % rows).astype(np.int32)
        self.indptr = np.searchsorted(pairs[fixed:] // rows, np.arange(rows + 1)).astype(np.int32)
        self._pulled = np.flatnonzero(self.indices >= self.free)
        starts = np.searchsorted(self._pulled, self.indptr).astype(np.int32)
        self._pulled_pattern = (self.indices[self._pulled] - self.free).astype(np.int32), starts

    def fix(self, blocks: Array, diagonal: Array) -> None:
        """Decouple the constant components (`Unknowns.fixed`) of blocks (k, 3, 3), in place.

        Their diagonal entries are taken from the blocks ``diagonal``; all other entries in their rows and columns
        become zero.
        """
        if not len(self._fixed):
            return
        rows = self._block_rows
        moves = np.ones((self.free + self.members, 3))
        moves.reshape(-1)[self._fixed] = 0.0
        beside = np.flatnonzero(~(moves[rows].all(axis=1) & moves[self.indices].all(axis=1)))
        first, second = rows[beside], self.indices[beside]
        kept = diagonal[beside] * ((first == second)[:, None, None] * (1.0 - moves[first])[:, :, None] * np.eye(3))
        blocks[beside] *= moves[first][:, :, None] * moves[second][:, None, :]
        blocks[beside] += kept

    @property
    def _block_rows(self) -> NDArray[np.intp]:
        """Row of each block (k,)."""
        return np.repeat(np.arange(len(self.indptr) - 1), np.diff(self.indptr))

    def blocks(self, tangents: Sequence[Array]) -> Array:
        """Return the sum of the groups' tangents (m, 3 c, 3 c) [N/m] in blocks (k, 3, 3)."""
        out = np.zeros((len(self.indices), 3, 3))
        for tangent, slot in zip(tangents, self._slots, strict=True):
            add_tangents(tangent, slot, out)
        return out

    def spread(self, matrix: sparse.csc_matrix, unknowns: Unknowns) -> Array:
        """Return the blocks (k, 3, 3) of a matrix (n, n) that acts on x, y and z alike, in the same pattern."""
        chosen = np.concatenate([unknowns.free, unknowns.members])
        part = matrix[chosen][:, chosen].tocsr()
        values = np.asarray(part[self._block_rows, self.indices]).ravel()
        return values[:, None, None] * np.eye(3)

    def graph(self) -> sparse.csr_matrix:
        """Return the pattern as a matrix (f + b, f + b) with an entry for every coupled pair of vertices."""
        size = self.free + self.members
        return sparse.csr_matrix((np.ones(len(self.indices)), self.indices, self.indptr), shape=(size, size))

    @property
    def among_free(self) -> NDArray[np.bool_]:
        """Whether each block (k,) belongs to two free vertices."""
        return (self._block_rows < self.free) & (self.indices < self.free)

    def by_members(self, blocks: Array) -> sparse.bsr_matrix:
        """Return the columns (3 f + 3 b, 3 b) of handles' vertices of the matrix that has the ``blocks`` (k, 3, 3)."""
        shape = 3 * (self.free + self.members), 3 * self.members
        return sparse.bsr_matrix((blocks[self._pulled], *self._pulled_pattern), shape=shape)


def _names(rows: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return a number (m c c,) for each pair of rows in a group (m, c), equal for equal pairs; -1 if a row is fixed."""
    first, second = rows[:, :, None], rows[:, None, :]
    return np.where((first >= 0) & (second >= 0), first * count + second, -1).ravel()


@dataclass(frozen=True, eq=False, kw_only=True)
class Tangent:
    """A tangent stiffness that preconditions several solves (a *kept* tangent); an immutable value.

    Attributes:
        blocks: (k, 3, 3) [N/m] blocks of coupled pairs of vertices; their matrix of the free vertices is positive
            definite.
        motion: (3 b, 3 q) derivative of the positions of the handles' vertices with respect to the rigid rows.
        positions: (n, 3) [m] at which the tangent was evaluated; None for the constant matrix, which does not follow
            rotations.
        shift: multiple of the constant matrix that was added for definiteness.
        springs: (m, 3 r) [(N/m)^(1/2)] the matrix G, with one row for each spring.
        owners: (m,) int32 term of each spring.
        stages: (t,) int32 stages of the terms (`Term.stage`); empty if all are 0.
        spent: number of iterations since the tangent was evaluated.
        solves: number of solves with the tangent.
        latest: number of iterations in the last of these solves.
    """

    blocks: Array
    motion: Array
    positions: Array | None = None
    shift: float = 0.0
    springs: Array = field(default_factory=lambda: np.zeros((0, 0)))
    owners: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    stages: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    spent: int = 0
    solves: int = 0
    latest: int = 0

    def overdue(self, cost: float) -> bool:
        """Return whether a new tangent, at the cost of ``cost`` iterations, would lower the mean cost of a solve."""
        return self.latest * self.solves > cost + self.spent
