# SPDX-License-Identifier: Apache-2.0
"""Banded Cholesky factors by LAPACK, for comparison with the solver's factors."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.linalg.lapack import dpbtrf, dpbtrs


class Band:
    """Banded Cholesky factor of matrices that have one common pattern.

    Args:
        graph: pattern (f, f): one entry for each block (3, 3) of the matrices, symmetric, in the order of the blocks.
        order: order of the f vertices (f,) that makes the band narrow.

    Attributes:
        width: number of entries of a column, from the diagonal to the edge of the band.
    """

    def __init__(self, graph: sparse.csr_matrix, order: NDArray[np.int64]) -> None:
        rank, axes = np.argsort(order), np.arange(3)
        rows = np.repeat(rank, np.diff(graph.indptr))
        rows, columns = np.broadcast_arrays(
            3 * rows[:, None, None] + axes[:, None], 3 * rank[graph.indices][:, None, None] + axes
        )
        self._below = np.flatnonzero(rows.ravel() >= columns.ravel())
        lower = (rows - columns).ravel()[self._below]
        self._size, self.width = 3 * len(order), int(lower.max(initial=0)) + 1
        self._order = (3 * order[:, None] + axes).ravel()
        self._place = columns.ravel()[self._below] * self.width + lower
        self._factor = np.zeros((self.width, 0), order="F")

    def factor(self, blocks: NDArray[np.float64]) -> bool:
        """Factor a matrix with blocks (k, 3, 3); return False, without a factor, if it is not positive definite."""
        band = np.zeros((self.width, self._size), order="F")
        band.ravel(order="K")[self._place] = blocks.ravel()[self._below]
        self._factor, info = dpbtrf(band, lower=1, overwrite_ab=1)
        return info == 0 and bool(np.isfinite(self._factor[0]).all())

    def solve(self, right: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the solution for right-hand sides (3 f,) or (3 f, k), with the last factor."""
        found, _ = dpbtrs(self._factor, right[self._order], lower=1, overwrite_b=1)
        solution = np.empty_like(found)
        solution[self._order] = found
        return solution
