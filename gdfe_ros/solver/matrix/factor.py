# SPDX-License-Identifier: Apache-2.0
"""Factors of symmetric positive definite matrices, one of each matrix in a process: equal bodies share theirs."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable
from enum import Enum
from weakref import WeakValueDictionary

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

try:
    import cholespy
except ImportError:  # an extra: scipy serves where it is missing
    cholespy = None

DENSE_UP_TO = 200
"""Free vertices up to which an explicit inverse, applied in compiled code, is the fastest."""


class Factorisation(str, Enum):
    """What solves with the constant matrix."""

    DENSE = "dense inverse"
    CHOLESPY = "cholespy"
    SCIPY = "scipy splu"


class Factor:
    """A factored matrix.

    Args:
        matrix: (f, f), symmetric positive definite.
        kind: what factors it; `Factorisation.DENSE` is beside the inverse scipy's.

    Attributes:
        inverse: (f, f) of `Factorisation.DENSE`; (0, 0) of the others.

    Raises:
        ValueError: cholespy was asked for and is not installed.
    """

    def __init__(self, matrix: sparse.csc_matrix, kind: Factorisation) -> None:
        if kind is Factorisation.CHOLESPY and cholespy is None:
            raise ValueError("cholespy is not installed; install the extra: pip install 'gdfe_ros[fast]'")
        self._solve, self._lock = _solver(matrix, kind), threading.Lock()
        dense = kind is Factorisation.DENSE
        self.inverse = np.ascontiguousarray(np.linalg.inv(matrix.toarray())) if dense else np.zeros((0, 0))

    def solve(self, right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Write the solution (f, 3) of three right-hand sides (f, 3) to ``out``; one thread at a time."""
        with self._lock:
            self._solve(right, out)


_MADE: WeakValueDictionary[bytes, Factor] = WeakValueDictionary()
"""Factors that some body of the process has, by the digest of their matrix."""


def factor_of(matrix: sparse.csc_matrix, kind: Factorisation) -> Factor:
    """Return the factor of a matrix (f, f): that which another body of the process has of an equal one, or a new one.

    Raises:
        ValueError: as `Factor`.
    """
    digest = hashlib.blake2b(f"{kind.value} {matrix.shape}".encode())
    for part in (matrix.indptr, matrix.indices, matrix.data):
        digest.update(np.ascontiguousarray(part).data)
    key = digest.digest()
    found = _MADE.get(key)
    if found is None:
        found = _MADE.setdefault(key, Factor(matrix, kind))
    return found


def usual_kind(count: int) -> Factorisation:
    """Return what is fastest for a number of free vertices, of what is installed."""
    if count <= DENSE_UP_TO:
        return Factorisation.DENSE
    return Factorisation.SCIPY if cholespy is None else Factorisation.CHOLESPY


def _solver(
    matrix: sparse.csc_matrix, kind: Factorisation
) -> Callable[[NDArray[np.float64], NDArray[np.float64]], None]:
    if matrix.shape[0] == 0:
        return lambda right, out: None
    if kind is Factorisation.CHOLESPY:
        entries = matrix.tocoo()
        indices = entries.row.astype(np.int32), entries.col.astype(np.int32)
        return cholespy.CholeskySolverD(matrix.shape[0], *indices, entries.data, cholespy.MatrixType.COO).solve
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def solve(right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        out[...] = factor.solve(right)

    return solve
