# SPDX-License-Identifier: Apache-2.0
"""The tangent stiffness of a body's movable vertices, 3 x 3 block by block."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.matrix.unknowns import Unknowns


@kernel
def add_elements(stiffness, slot, out):
    """Add elements' tangents (m, 24, 24), made symmetric, to ``out`` (k, 3, 3) at ``slot`` (m, 8, 8); -1: nowhere."""
    for e in range(len(slot)):
        for a in range(8):
            for b in range(8):
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
        cells: (m, 8) corners of the elements.
        unknowns: the numbering.

    Attributes:
        free, members: number of free vertices, and of those of handles with a free axis.
        indices, indptr: int32, of the block rows.
    """

    def __init__(self, cells: NDArray[np.int32], unknowns: Unknowns) -> None:
        self.free, self.members = len(unknowns.free), len(unknowns.members)
        rows = self.free + self.members
        number = np.full(int(cells.max()) + 1, -1)
        number[np.concatenate([unknowns.free, unknowns.members])] = np.arange(rows)
        first = np.repeat(number[cells], 8, axis=1).ravel()
        second = np.tile(number[cells], (1, 8)).ravel()
        moves = (first >= 0) & (second >= 0)
        pairs, inverse = np.unique(first[moves] * rows + second[moves], return_inverse=True)
        slot = np.full(len(first), -1, np.int32)
        slot[moves] = inverse
        self._slot = slot.reshape(len(cells), 8, 8)
        self.indices = (pairs % rows).astype(np.int32)
        self.indptr = np.searchsorted(pairs // rows, np.arange(rows + 1)).astype(np.int32)

    def blocks(self, stiffness: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sum the elements' tangents (m, 24, 24) [N/m] to blocks (k, 3, 3)."""
        out = np.zeros((len(self.indices), 3, 3))
        add_elements(stiffness, self._slot, out)
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
