# SPDX-License-Identifier: Apache-2.0
"""Cholesky factors of symmetric matrices whose pattern stays: banded, as slender bodies are, or sparse."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.linalg.lapack import dpbtrf, dpbtrs
from scipy.sparse.linalg import splu

BROADEST = 40_000_000
"""Numbers in a band up to which it is used: 320 MB. Up to there LAPACK's band is the faster of the two to factor."""


class Factor:
    """Factors matrices of one pattern, one after the other.

    Args:
        matrix: (n, n) with the pattern, which is symmetric.
        order: (n,) in which its band is narrow.

    Attributes:
        price: of a factor, in solutions.
    """

    def __init__(self, matrix: sparse.csr_matrix, order: NDArray[np.int64]) -> None:
        self._size, self._order = matrix.shape[0], order
        rank = np.empty(self._size, np.int64)
        rank[self._order] = np.arange(self._size)
        rows = rank[np.repeat(np.arange(self._size), np.diff(matrix.indptr))]
        columns = rank[matrix.indices]
        self._below = np.flatnonzero(rows >= columns)
        lower = rows[self._below] - columns[self._below]
        self._width = int(lower.max(initial=0)) + 1
        self._banded = self._width * self._size <= BROADEST
        self.price = self._width // 8
        self._place = columns[self._below] * self._width + lower
        self._factor = None

    def factor(self, matrix: sparse.csr_matrix) -> bool:
        """Factor a matrix (n, n); return whether it is positive definite, otherwise there is no factor."""
        if self._size == 0:
            return True
        if self._banded:
            band = np.zeros((self._width, self._size), order="F")
            band.ravel(order="K")[self._place] = matrix.data[self._below]
            self._factor, info = dpbtrf(band, lower=1, overwrite_ab=1)
            return info == 0
        options = {"SymmetricMode": True}
        try:
            self._factor = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        except RuntimeError:  # exactly singular
            return False
        return bool((self._factor.U.diagonal() > 0.0).all())

    def solve(self, right: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the solution for right-hand sides (n,) or (n, k)."""
        if self._size == 0:
            return right.copy()
        if not self._banded:
            return self._factor.solve(right)
        found, _ = dpbtrs(self._factor, right[self._order], lower=1, overwrite_b=1)
        solution = np.empty_like(found)
        solution[self._order] = found
        return solution
