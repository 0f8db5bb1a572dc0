# SPDX-License-Identifier: Apache-2.0
"""Coupling of the rigid rows to the free vertices: block elimination with one factor for x, y and z.

The constant matrix does not couple x, y and z, but a rotation does. About the rest pose, a handle moves its vertices by
dx = dt + dtheta x r, with the undeformed position r relative to its centre. With the motion B of the vertices by the
rigid rows, the free vertices follow by -H with H = A_ff^-1 A_fm B, and the rigid rows have the Schur complement
S = B^T A_mm B - (A_fm B)^T H.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.matrix.inverse import Inverse
from gdfe_ros.solver.matrix.substitution import solve_rigid
from gdfe_ros.solver.matrix.unknowns import Unknowns, clear_fixed

SINGULAR = 1e-10
"""A rigid motion counts as having no stiffness if its eigenvalue of the Schur complement is below this fraction of the
largest eigenvalue.
"""

Solve = Callable[[NDArray[np.float64], NDArray[np.float64]], None]


class Coupling(NamedTuple):
    """Data that extend a solve of the free vertices to the rigid rows; empty if no handle has a free axis.

    Attributes:
        harmonic: (3 f, 3 q) H, displacement of the free vertices that each component of the rigid rows causes, times
            -1.
        inverse_schur: (3 q, 3 q) inverse of the Schur complement S, zero for prescribed components.
        inverse: inverse of the free block A_ff, for the kernels.
        fixed: (k,) int64 components of the free rows that are constant (`Unknowns.fixed`).
    """

    harmonic: NDArray[np.float64]
    inverse_schur: NDArray[np.float64]
    inverse: Inverse
    fixed: NDArray[np.int64]


def couple(
    matrix: sparse.csc_matrix, rest: NDArray[np.float64], unknowns: Unknowns, solve: Solve, inverse: Inverse
) -> Coupling:
    """Return the coupling of handles in their rest poses to the free vertices, linearised.

    Args:
        matrix: the assembled matrix (n, n).
        rest: (n, 3) rest vertices [m].
        unknowns: the numbering of the unknowns.
        solve: function that solves with the free block A_ff for three right-hand sides (f, 3).
        inverse: the inverse of this block, for the kernels.
    """
    motion, rows = rigid_motion(rest, unknowns), matrix[:, unknowns.members]
    wide = motion.reshape(len(motion), motion.shape[1] * motion.shape[2])
    pulled = (rows @ wide).reshape(len(rest), *motion.shape[1:])
    columns = np.moveaxis(pulled[unknowns.free], -1, 0)
    harmonic = np.zeros_like(columns, order="C")
    for column, follows in zip(columns, harmonic, strict=True):
        solve(np.ascontiguousarray(column), follows)
    schur = np.einsum("mia,mib->ab", motion, pulled[unknowns.members]) - np.einsum("afi,bfi->ab", columns, harmonic)
    spread = np.ascontiguousarray(harmonic.reshape(len(harmonic), 3 * len(unknowns.free)).T)
    return Coupling(spread, _pseudo_inverse(schur), inverse, unknowns.fixed)


def rigid_motion(rest: NDArray[np.float64], unknowns: Unknowns) -> NDArray[np.float64]:
    """Return the displacement (b, 3, 3 q) of the handles' vertices by each component of the rigid rows, at rest."""
    motion = np.zeros((len(unknowns.members), 3, 3 * unknowns.rigid_rows))
    for p, (begin, end) in enumerate(zip(unknowns.member_start[:-1], unknowns.member_start[1:], strict=True)):
        own, places = motion[begin:end], rest[unknowns.members[begin:end]]
        own[:, :, 3 * p : 3 * p + 3] = np.diag(unknowns.slides[p])
        if unknowns.turn_row[p] >= 0:
            first, arms = 3 * (unknowns.turn_row[p] - len(unknowns.free)), places - places.mean(axis=0)
            axes = np.eye(3) * unknowns.turns[p] / unknowns.radius[p]
            own[:, :, first : first + 3] = np.moveaxis(np.cross(axes, arms[:, None]), 1, 2)
    return motion


def _pseudo_inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pseudo-inverse of a symmetric matrix; eigenvalues below `SINGULAR` times the largest count as zero."""
    if not len(matrix):
        return matrix
    values, vectors = np.linalg.eigh(matrix)
    return spectral_inverse(values, vectors, SINGULAR * np.abs(values).max())


def spectral_inverse(values: NDArray[np.float64], vectors: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Return the pseudo-inverse of a symmetric matrix from its eigenvalues (k,) and eigenvectors (k, k).

    Eigenvalues whose magnitude is at most ``least`` count as zero.
    """
    shares = np.divide(1.0, values, out=np.zeros_like(values), where=np.abs(values) > least)
    return np.ascontiguousarray(vectors * shares @ vectors.T)


@kernel
def close_coupling(gradient, coupling, out):
    """Complete ``out`` (3 r,) to A^-1 ``gradient``; its rows of free vertices already contain A_ff^-1 gradient.

    Components that are constant become zero.
    """
    if len(coupling.inverse_schur):
        solve_rigid(coupling.harmonic, coupling.inverse_schur, gradient, out)
    clear_fixed(coupling.fixed, out)
