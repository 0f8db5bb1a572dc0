# SPDX-License-Identifier: Apache-2.0
"""Factors of symmetric positive definite matrices; equal matrices in a process have one factor."""

from __future__ import annotations

import hashlib
from weakref import WeakValueDictionary

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.solver.matrix.fronts import Fronts
from gdfe_ros.solver.matrix.substitution import Inverse, apply_free


class Factor:
    """A factored matrix.

    Args:
        matrix: (f, f), symmetric positive definite.
        points: (f, 3) positions of its vertices [m].

    Attributes:
        inverse: the inverse for the kernels. If rounding leaves the matrix not definite, as for a body that nothing
            holds, it is the inverse of the matrix plus a small multiple of its largest diagonal entry.
    """

    COARSE_FROM = 4_000_000
    """A factor with at least this number of entries is stored in single precision."""
    REGULAR = 1e-12
    """Multiple of the largest diagonal entry that is added to the diagonal of a matrix without a factor; it grows
    tenfold until there is one.
    """
    ZEROS = 0.3
    """Largest fraction of zeros in a supernode. This matrix is factored once and used often; broad supernodes are then
    fastest.
    """
    REFINED = 3
    """Number of corrections of a solution with a factor in single precision."""

    def __init__(self, matrix: sparse.csc_matrix, points: NDArray[np.float64]) -> None:
        self._matrix = matrix
        graph = matrix.tocsr()
        graph.sort_indices()
        fronts, added = Fronts(graph, points, size=1, slack=self.ZEROS, kind=np.float64), self.REGULAR
        own = graph.indices == np.repeat(np.arange(len(points)), np.diff(graph.indptr))
        while not fronts.factor(graph.data[:, None, None]):
            graph.data[own] += added * graph.data[own].max()
            added *= 10.0
        kept, none = fronts.kept, np.zeros(0)
        coarse = len(kept.values) >= self.COARSE_FROM
        values = (none, kept.values.astype(np.float32)) if coarse else (kept.values, none.astype(np.float32))
        self.inverse = Inverse(kept.plan, kept.order, *values)

    def solve(self, right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Write the solution (f, 3) of three right-hand sides (f, 3) to ``out``, to double precision."""
        apply_free(self.inverse, right.reshape(-1), out.reshape(-1))
        for _ in range(self.REFINED if len(self.inverse.coarse) else 0):
            change = np.empty_like(out)
            apply_free(self.inverse, (right - self._matrix @ out).reshape(-1), change.reshape(-1))
            out += change


_MADE: WeakValueDictionary[bytes, Factor] = WeakValueDictionary()
"""Dict from the digest of a matrix and its vertices to the factor that is in use in the process."""


def factor_of(matrix: sparse.csc_matrix, points: NDArray[np.float64]) -> Factor:
    """Return the factor of a matrix (f, f); an equal matrix in the process has the same factor."""
    digest = hashlib.blake2b(str(matrix.shape).encode())
    for part in (matrix.indptr, matrix.indices, matrix.data, points):
        digest.update(np.ascontiguousarray(part).data)
    key = digest.digest()
    found = _MADE.get(key)
    if found is None:
        found = _MADE.setdefault(key, Factor(matrix, points))
    return found
