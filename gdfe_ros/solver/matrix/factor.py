# SPDX-License-Identifier: Apache-2.0
"""Factors of symmetric positive definite matrices; equal matrices in a process have one factor.

The sparse Cholesky factor A = U^T U is made by the multifrontal method (Liu 1992), with LAPACK. Each supernode
assembles its entries of the matrix and its children's update matrices in a dense front. It eliminates its own vertices
there, and passes the remaining update matrix to its parent.
"""

from __future__ import annotations

import hashlib
from enum import Enum
from weakref import WeakValueDictionary

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from gdfe_ros.blas import one_blas_thread
from gdfe_ros.compiled import kernel
from gdfe_ros.solver.matrix.elimination import Elimination, dissected, eliminated, grouped, narrow_order
from gdfe_ros.solver.matrix.inverse import LINE, Inverse, apply_free

CODES = np.iinfo(np.int16).max
"""Integer that stands for the largest entry of a row."""


@kernel
def extend(left, places, front):
    """Add a child's update matrix (p, p), lower triangle, to the rows ``places`` (p,) of the front."""
    for b in range(len(places)):
        row, line = left[b], front[places[b]]
        for a in range(b + 1):
            line[places[a]] += row[a]


def supernodal(matrix: sparse.csc_matrix, points: NDArray[np.float64], *, exact: bool = False) -> Inverse:
    """Return the factor of a matrix (f, f) of vertices at ``points`` (f, 3) [m], for the kernels.

    A large factor is stored as 16-bit integers, unless ``exact`` is set. Where rounding leaves the matrix not positive
    definite, as for a body that nothing holds, a small multiple of the diagonal is added.
    """
    graph = matrix.tocsr()
    graph.sort_indices()
    orders = narrow_order(graph, points), dissected(graph, points)
    found = eliminated(graph, orders, power=1, slack=Factor.ZEROS)
    large = found.entries >= Factor.COARSE_FROM
    found, group_start = grouped(found, Factor.GROUPS if large else 0)
    length = -(-found.heights // LINE) * LINE
    start = np.concatenate([[0], np.cumsum(found.widths * length)]).astype(np.int64)
    coarse = large and not exact
    values, none = np.zeros(start[-1] + length.max(), np.int16 if coarse else np.float64), np.zeros(0)
    pivot, scale = np.zeros((2, len(points)))
    lists = found.order, found.first, found.row_start, found.rows, group_start, length, start, pivot, scale
    kept = (none, values) if coarse else (values, none.astype(np.int16))
    inverse = Inverse(np.zeros((0, 0)), *lists, *kept)
    with one_blas_thread():
        _factor(graph, found, inverse, values)
    return inverse


def _factor(graph: sparse.csr_matrix, found: Elimination, inverse: Inverse, values: NDArray) -> None:
    """Write the factor to an inverse, whose ``values`` are given, supernode by supernode."""
    taken, rows, columns, part_start = found.parts(graph)
    entries = graph.data[taken]
    inside, widths = found.inside(), found.widths
    left: dict[int, list[tuple[NDArray[np.float64], NDArray[np.int64]]]] = {}
    for node in range(len(widths)):
        begin, end = found.row_start[node : node + 2]
        own, height = int(widths[node]), int(end - begin)
        front = np.zeros((height, height), order="F")
        parts = slice(*part_start[node : node + 2])
        front[rows[parts], columns[parts]] = entries[parts]
        for child, places in reversed(left.pop(node, [])):
            extend(child, places, front.T)
        upper, failed = dpotrf(front[:own, :own], clean=1)
        added = Factor.REGULAR * float(np.abs(front[range(own), range(own)]).max())
        while failed:
            front[range(own), range(own)] += added
            upper, failed = dpotrf(front[:own, :own], clean=1)
            added *= 10.0
        own_rows = np.zeros((own, height))
        own_rows[:, :own] = upper
        if own < height:
            own_rows[:, own:] = beyond = dtrsm(1.0, upper, front[:own, own:], trans_a=1)
            rest = dsyrk(-1.0, beyond, beta=1.0, c=front[own:, own:], trans=1)
            left.setdefault(int(found.parent[node]), []).append((rest.T, inside[begin + own : end]))
        lines = slice(*found.first[node : node + 2])
        kept = values[slice(*inverse.value_start[node : node + 2])].reshape(own, -1)
        _keep(own_rows, kept, inverse.pivot[lines], inverse.scale[lines])


def _keep(rows: NDArray[np.float64], kept: NDArray, pivot: NDArray[np.float64], scale: NDArray[np.float64]) -> None:
    """Write rows (k, h) of U to ``kept`` (k, length), ``pivot`` (k,) and ``scale`` (k,), as `Inverse` describes."""
    own = range(len(rows))
    pivot[...], scale[...] = 1.0 / rows[own, own], 1.0
    rows[own, own] = 0.0
    if kept.dtype == np.int16:
        largest = np.abs(rows).max(axis=1)
        scale[largest > 0.0] = largest[largest > 0.0] / CODES
        rows = np.rint(rows / scale[:, None])
    kept[:, : rows.shape[1]] = rows


class Factorisation(str, Enum):
    """Method of solving with the constant matrix."""

    DENSE = "dense inverse"
    SUPERNODES = "supernodes"


class Factor:
    """A factored matrix.

    Args:
        matrix: (f, f), symmetric positive definite.
        points: (f, 3) positions of its vertices [m].
        kind: method of factorisation.

    Attributes:
        kind: the argument.
        inverse: the inverse for the kernels. If `Factorisation.SUPERNODES` finds the matrix not definite, because of
            rounding, it is the inverse of the matrix plus a small multiple of its diagonal.
    """

    DENSE_UP_TO = 200
    """Up to this number of free vertices, an explicit inverse, applied in compiled code, is the fastest method."""
    COARSE_FROM = 4_000_000
    """A factor with at least this number of entries is stored as 16-bit integers."""
    GROUPS = 4
    """Number of groups of supernodes in a large factor; threads divide the groups."""
    REGULAR = 1e-12
    """Multiple of the largest diagonal entry of a supernode that is added to its diagonal if it has no factor; it grows
    tenfold until there is one.
    """
    ZEROS = 0.15
    """Largest fraction of zeros in a supernode. This matrix is factored once and used often; few zeros are then
    fastest.
    """
    SOUND = 1e-3
    """A factor is stored in 16 bits if the relative correction of a solution is at most this. The factor serves as
    preconditioner, and to estimate the distance to the equilibrium.
    """
    REFINED = 3
    """Number of corrections of a solution with a factor of 16 bits; each reduces the error to at most the fraction
    `SOUND`.
    """

    def __init__(self, matrix: sparse.csc_matrix, points: NDArray[np.float64], kind: Factorisation) -> None:
        self.kind, self.inverse, self._matrix = kind, Inverse.of(), matrix
        if matrix.shape[0] == 0:
            return
        if kind is Factorisation.DENSE:
            self.inverse = Inverse.of(np.ascontiguousarray(np.linalg.inv(matrix.toarray())))
        else:
            self.inverse = supernodal(matrix, points)
            if not self._sound():
                self.inverse = supernodal(matrix, points, exact=True)

    def solve(self, right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Write the solution (f, 3) of three right-hand sides (f, 3) to ``out``, to double precision."""
        apply_free(self.inverse, right.reshape(-1), out.reshape(-1), None)
        for _ in range(self.REFINED if len(self.inverse.coarse) else 0):
            out += self._correction(right, out)

    def _sound(self) -> bool:
        """Return whether the factor is accurate enough, in particular for the softest modes."""
        if not len(self.inverse.coarse):
            return True
        right = np.random.default_rng(0).standard_normal((self._matrix.shape[0], 3))
        out = np.empty_like(right)
        apply_free(self.inverse, right.reshape(-1), out.reshape(-1), None)
        return bool(np.linalg.norm(self._correction(right, out)) <= self.SOUND * np.linalg.norm(out))

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
    return Factorisation.DENSE if count <= Factor.DENSE_UP_TO else Factorisation.SUPERNODES
