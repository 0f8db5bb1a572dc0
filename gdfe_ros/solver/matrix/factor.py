# SPDX-License-Identifier: Apache-2.0
"""Factors of symmetric positive definite matrices; equal matrices in a process have one factor."""

from __future__ import annotations

import hashlib
from enum import Enum
from weakref import WeakValueDictionary

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.solver.matrix.inverse import Inverse, apply_free
from gdfe_ros.solver.matrix.supernodes import NotDefiniteError, supernodal
from gdfe_ros.sparse_lu import LuFactor

DENSE_UP_TO = 200
"""Up to this number of free vertices, an explicit inverse, applied in compiled code, is the fastest method."""
SOUND = 1e-3
"""A factor is stored in 16 bits if the relative correction of a solution is at most this. The factor serves as
preconditioner, and to estimate the distance to the equilibrium.
"""
REFINED = 3
"""Number of corrections of a solution with a factor of 16 bits; each reduces the error to at most the fraction
`SOUND`.
"""


class Factorisation(str, Enum):
    """Library or method that solves with the constant matrix."""

    DENSE = "dense inverse"
    SUPERNODES = "supernodes"
    SCIPY = "scipy splu"


class Factor:
    """A factored matrix.

    Args:
        matrix: (f, f), symmetric positive definite.
        points: (f, 3) positions of its vertices [m].
        kind: method of factorisation. If `Factorisation.SUPERNODES` finds an almost singular matrix not definite,
            scipy's LU is used instead.

    Attributes:
        kind: the method in use.
        inverse: the inverse for the kernels; empty for scipy's LU.
    """

    def __init__(self, matrix: sparse.csc_matrix, points: NDArray[np.float64], kind: Factorisation) -> None:
        self.kind, self.inverse, self._matrix = kind, Inverse.of(), matrix
        self._library = None
        if matrix.shape[0] == 0:
            return
        if kind is Factorisation.DENSE:
            self.inverse = Inverse.of(np.ascontiguousarray(np.linalg.inv(matrix.toarray())))
        elif kind is Factorisation.SUPERNODES:
            try:
                self.inverse = supernodal(matrix, points)
                if not self._sound():
                    self.inverse = supernodal(matrix, points, exact=True)
            except NotDefiniteError:
                self.kind = Factorisation.SCIPY
        if self.kind is Factorisation.SCIPY:
            options = {"SymmetricMode": True}
            self._library = LuFactor(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)

    def solve(self, right: NDArray[np.float64], out: NDArray[np.float64], *, exact: bool = False) -> None:
        """Write the solution (f, 3) of three right-hand sides (f, 3) to ``out``.

        With a factor of 16 bits, the relative error is up to `SOUND`. If ``exact``, the solution is corrected
        `REFINED` times.
        """
        if self._library is not None:
            out[...] = self._library.solve(right)
            return
        apply_free(self.inverse, right.reshape(-1), out.reshape(-1), None)
        for _ in range(REFINED if exact and len(self.inverse.coarse) else 0):
            out += self._correction(right, out)

    def _sound(self) -> bool:
        """Return whether the factor is accurate enough, in particular for the softest modes."""
        if not len(self.inverse.coarse):
            return True
        right = np.random.default_rng(0).standard_normal((self._matrix.shape[0], 3))
        out = np.empty_like(right)
        apply_free(self.inverse, right.reshape(-1), out.reshape(-1), None)
        return bool(np.linalg.norm(self._correction(right, out)) <= SOUND * np.linalg.norm(out))

    def _correction(self, right: NDArray[np.float64], out: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the correction (f, 3) of a solution ``out`` (f, 3)."""
        change = np.empty_like(out)
        apply_free(self.inverse, (right - self._matrix @ out).reshape(-1), change.reshape(-1), None)
        return change


_MADE: WeakValueDictionary[bytes, Factor] = WeakValueDictionary()
"""Dict from the digest of a matrix and its vertices to the factor that is in use in the process."""


def factor_of(matrix: sparse.csc_matrix, points: NDArray[np.float64], kind: Factorisation) -> Factor:
    """Return the factor of a matrix (f, f); an equal matrix in the process has the same factor."""
    digest = hashlib.blake2b(f"{kind.value} {matrix.shape}".encode())
    for part in (matrix.indptr, matrix.indices, matrix.data, points):
        digest.update(np.ascontiguousarray(part).data)
    key = digest.digest()
    found = _MADE.get(key)
    if found is None:
        found = _MADE.setdefault(key, Factor(matrix, points, kind))
    return found


def usual_kind(count: int) -> Factorisation:
    """Return the fastest method for a number of free vertices."""
    return Factorisation.DENSE if count <= DENSE_UP_TO else Factorisation.SUPERNODES
