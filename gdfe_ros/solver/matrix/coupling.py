# SPDX-License-Identifier: Apache-2.0
"""Coupling of the rigid rows to the free vertices: block elimination with one factor for x, y and z.

The constant matrix does not couple x, y and z, but a rotation does. Each handle moves its vertices by scalar fields:
the constant 1 and, for a rotating handle, the three components of r, the undeformed position relative to the centre.
About the rest pose, dx = dt + dtheta x r. Each axis of this motion is a combination of the fields, whose harmonic
extensions give the Schur complement of the rigid rows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.solver.matrix.inverse import Inverse
from gdfe_ros.solver.matrix.unknowns import Unknowns, clear_fixed

CROSS = np.cross(np.eye(3)[:, None], np.eye(3)[None])
"""The numbers e_jki of the cross product (a x b)_i = e_jki a_j b_k."""
MANY = 48
"""Largest number of rigid unknowns whose coupling is summed directly; the time grows with its fourth power."""
SINGULAR = 1e-10
"""A rigid motion counts as having no stiffness if its eigenvalue of the Schur complement is below this fraction of the
largest eigenvalue.
"""

Solve = Callable[[NDArray[np.float64], NDArray[np.float64]], None]


class Coupling(NamedTuple):
    """Data that extend a solve of the free vertices to the rigid rows; empty if no handle has a free axis.

    Attributes:
        columns: (f, k) float64, the product A_fp b for each scalar field b [N/m times the field's unit].
        harmonic: (f, k) float64, A_ff^-1 columns.
        motion: (3, k, 3 q) float64, for each axis the coefficient of each field in each component of the rigid rows.
        inverse_schur: (3 q, 3 q) float64, inverse of the rigid rows' Schur complement, zero for prescribed components.
        inverse: inverse of the free block A_ff, for the kernels.
        fixed: (k,) int64 components of the free rows that are constant (`Unknowns.fixed`).
    """

    columns: NDArray[np.float64]
    harmonic: NDArray[np.float64]
    motion: NDArray[np.float64]
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
    fields, motion = _fields(rest, unknowns)
    columns = np.ascontiguousarray(matrix[unknowns.free] @ fields)
    harmonic = np.zeros_like(columns)
    for k in range(columns.shape[1]):
        solution = np.zeros((len(columns), 3))
        solve(np.ascontiguousarray(np.repeat(columns[:, [k]], 3, axis=1)), solution)
        harmonic[:, k] = solution[:, 0]
    gram = fields.T @ (matrix @ fields) - columns.T @ harmonic
    many = motion.shape[2] > MANY  # products of matrices, whose sums depend on the machine
    schur = np.einsum("ika,kl,ilb->ab", motion, gram, motion, optimize=many)
    return Coupling(columns, harmonic, motion, _pseudo_inverse(schur), inverse, unknowns.fixed)


def _fields(rest: NDArray[np.float64], unknowns: Unknowns) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the scalar fields (n, k) of all handles, and `Coupling.motion`."""
    turning, count = unknowns.turn_row >= 0, len(unknowns.free)
    first = np.cumsum([0, *np.where(turning, 4, 1)])
    fields, motion = np.zeros((len(rest), first[-1])), np.zeros((3, first[-1], 3 * unknowns.rigid_rows))
    for p, begin in enumerate(first[:-1]):
        members = unknowns.members[unknowns.member_start[p] : unknowns.member_start[p + 1]]
        fields[members, begin] = 1.0
        for axis in range(3):
            motion[axis, begin, 3 * p + axis] = unknowns.slides[p, axis]
        if turning[p]:
            fields[members, begin + 1 : begin + 4] = rest[members] - rest[members].mean(axis=0)
            column = 3 * (unknowns.turn_row[p] - count)
            # For each axis, dx is the cross product with r: row i contains the coefficients of r's three components.
            scale = unknowns.turns[p] / unknowns.radius[p]
            motion[:, begin + 1 : begin + 4, column : column + 3] = CROSS.transpose(2, 1, 0) * scale
    return fields, motion


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
    close_rigid(gradient, coupling, out)
    clear_fixed(coupling.fixed, out)


@internal
def close_rigid(gradient, coupling, out):
    """Do `close_coupling`, but do not clear constant components."""
    count, fields = coupling.columns.shape
    rigid = len(coupling.inverse_schur)
    if rigid == 0:
        return
    load, share = np.zeros(rigid), np.zeros((3, fields))
    for axis in range(3):
        for k in range(fields):
            total = 0.0
            for i in range(count):
                total += coupling.columns[i, k] * out[3 * i + axis]
            share[axis, k] = total
    for a in range(rigid):
        load[a] = gradient[3 * count + a]
        for axis in range(3):
            for k in range(fields):
                load[a] -= coupling.motion[axis, k, a] * share[axis, k]
    for a in range(rigid):
        total = 0.0
        for b in range(rigid):
            total += coupling.inverse_schur[a, b] * load[b]
        out[3 * count + a] = total
    for axis in range(3):
        for k in range(fields):
            total = 0.0
            for a in range(rigid):
                total += coupling.motion[axis, k, a] * out[3 * count + a]
            if total != 0.0:
                for i in range(count):
                    out[3 * i + axis] -= coupling.harmonic[i, k] * total
