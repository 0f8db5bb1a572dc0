# SPDX-License-Identifier: Apache-2.0
"""The constant global matrix: one n x n system for x, y and z, factored once (Sec. 3.2)."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from gdfe_ros.compiled import kernel, vector_kernel
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.unknowns import Unknowns

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


class Coupling(NamedTuple):
    """How the sliding plates hang on the free vertices; empty where none slides.

    Attributes:
        columns: (f, p) float64, matrix entries between free vertices and each plate as a whole.
        harmonic: (f, p) float64, A_ff^-1 columns.
        schur: (3, p, p) float64, inverse of the plates' Schur complement along each axis, zero where prescribed.
        inverse: (f, f) float64 explicit inverse, or (0, 0).
    """

    columns: NDArray[np.float64]
    harmonic: NDArray[np.float64]
    schur: NDArray[np.float64]
    inverse: NDArray[np.float64]


def assemble(shape: ShapeOperators, weight: NDArray[np.float64], hourglass: NDArray[np.float64]) -> sparse.csc_matrix:
    """Assemble sum_e w_e V_e g g^T + c_e sum_k gamma_k gamma_k^T, (n, n).

    Args:
        shape: the elements.
        weight: w_e (m,) [Pa].
        hourglass: c_e (m,) [N/m].
    """
    blocks = np.einsum("e,eai,ebi->eab", weight * shape.volume, shape.gradient, shape.gradient)
    blocks += np.einsum("e,eka,ekb->eab", hourglass, shape.hourglass, shape.hourglass)
    return _scatter(blocks, shape)


def assemble_centring(shape: ShapeOperators) -> sparse.csc_matrix:
    """Assemble the paper's A^T A = sum_e V_e N with N = I - 1/8 (Eq. 3), (n, n)."""
    return _scatter(shape.volume[:, None, None] * (np.eye(8) - 0.125), shape)


def _scatter(blocks: NDArray[np.float64], shape: ShapeOperators) -> sparse.csc_matrix:
    rows, columns = np.repeat(shape.cells, 8, axis=1).ravel(), np.tile(shape.cells, (1, 8)).ravel()
    return sparse.coo_matrix((blocks.ravel(), (rows, columns))).tocsc()


class GlobalMatrix:
    """The matrix restricted to the unknowns, factored; x, y and z share one factor.

    A plate that slides along some axes only would give each axis a matrix of its own; its Schur complement is taken
    instead, so that one factor of the free vertices serves all three.

    Args:
        matrix: the assembled matrix (n, n), symmetric.
        unknowns: the numbering of the unknowns.
        library: which library factors; None takes cholespy where it is installed, else scipy.

    Raises:
        ValueError: cholespy was asked for and is not installed.
    """

    def __init__(self, matrix: sparse.csc_matrix, unknowns: Unknowns, *, library: Factorisation | None = None) -> None:
        if library is Factorisation.CHOLESPY and cholespy is None:
            raise ValueError("cholespy is not installed; install the extra: pip install 'gdfe_ros[fast]'")
        self._assembled, self._unknowns, self._library = matrix, unknowns, library
        self._whole: GlobalMatrix | None = None
        free = unknowns.free
        rows = matrix[free]
        block = rows[:, free].tocsc()
        self._prescribed = rows[:, unknowns.prescribed].tocsr()
        self.kind = library or self._choose(len(free))
        self._solve = self._factor(block)
        self.coupling = self._couple(matrix, rows, unknowns)
        if self.kind is Factorisation.DENSE:
            self.coupling = self.coupling._replace(inverse=np.ascontiguousarray(np.linalg.inv(block.toarray())))

    def part(self, unknowns: Unknowns) -> GlobalMatrix:
        """Factor the rows of fewer ``unknowns``; the rest is held."""
        part = GlobalMatrix(self._assembled, unknowns, library=self._library)
        part._whole = self
        return part

    def __deepcopy__(self, memo: dict[int, Any]) -> GlobalMatrix:
        return self

    def __getstate__(self) -> dict[str, Any]:
        """Save a part as the way to factor it again; the whole matrix belongs to the scene."""
        return {"whole": self._whole, "unknowns": self._unknowns}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state["whole"].part(state["unknowns"]).__dict__)

    def solve(self, right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Solve A_ff out = right for the free vertices, three right-hand sides (f, 3)."""
        self._solve(right, out)

    def extend(self, motion: NDArray[np.float64]) -> NDArray[np.float64]:
        """Spread the motion (b, 3) [m] of the prescribed vertices over the free ones: the harmonic predictor (f, 3)."""
        right = np.ascontiguousarray(-(self._prescribed @ motion))
        out = np.empty_like(right)
        self.solve(right, out)
        return out

    def _choose(self, count: int) -> Factorisation:
        if count <= DENSE_UP_TO:
            return Factorisation.DENSE
        return Factorisation.SCIPY if cholespy is None else Factorisation.CHOLESPY

    def _factor(self, block: sparse.csc_matrix) -> Callable[[NDArray[np.float64], NDArray[np.float64]], None]:
        if block.shape[0] == 0:
            return lambda right, out: None
        if self.kind is Factorisation.CHOLESPY:
            entries = block.tocoo()
            indices = entries.row.astype(np.int32), entries.col.astype(np.int32)
            return cholespy.CholeskySolverD(block.shape[0], *indices, entries.data, cholespy.MatrixType.COO).solve
        factor = splu(block, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

        def solve(right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
            out[...] = factor.solve(right)

        return solve

    def _couple(self, matrix: sparse.csc_matrix, rows: sparse.csr_matrix, unknowns: Unknowns) -> Coupling:
        count, plates = len(unknowns.free), len(unknowns.plate_axes)
        owner = np.zeros((matrix.shape[0], plates))
        for plate in range(plates):
            start, stop = unknowns.plate_start[plate : plate + 2]
            owner[unknowns.plate_vertices[start:stop], plate] = 1.0
        columns = np.ascontiguousarray(rows @ owner)
        harmonic = np.zeros_like(columns)
        for plate in range(plates):
            solution = np.zeros((count, 3))
            self.solve(np.ascontiguousarray(np.repeat(columns[:, [plate]], 3, axis=1)), solution)
            harmonic[:, plate] = solution[:, 0]
        complement = owner.T @ (matrix @ owner) - columns.T @ harmonic
        schur = np.zeros((3, plates, plates))
        for axis in range(3):
            sliding = np.flatnonzero(unknowns.plate_axes[:, axis])
            schur[axis][np.ix_(sliding, sliding)] = np.linalg.inv(complement[np.ix_(sliding, sliding)])
        return Coupling(columns, harmonic, schur, np.zeros((0, 0)))


@vector_kernel
def apply_inverse(gradient, coupling, out):
    """Write A^-1 gradient (3 r,) by the explicit inverse of the free block."""
    count = len(coupling.inverse)
    for i in range(count):
        for axis in range(3):
            out[3 * i + axis] = 0.0
        for j in range(count):
            weight = coupling.inverse[i, j]
            out[3 * i] += weight * gradient[3 * j]
            out[3 * i + 1] += weight * gradient[3 * j + 1]
            out[3 * i + 2] += weight * gradient[3 * j + 2]
    close_coupling(gradient, coupling, out)


@kernel
def close_coupling(gradient, coupling, out):
    """Complete ``out`` (3 r,), whose first rows hold A_ff^-1 gradient, by the sliding plates (block elimination)."""
    count, plates = coupling.columns.shape
    for axis in range(3):
        for p in range(plates):
            out[3 * (count + p) + axis] = 0.0
        for p in range(plates):
            rest = gradient[3 * (count + p) + axis]
            for i in range(count):
                rest -= coupling.columns[i, p] * out[3 * i + axis]
            for other in range(plates):
                out[3 * (count + other) + axis] += coupling.schur[axis, other, p] * rest
        for p in range(plates):
            motion = out[3 * (count + p) + axis]
            if motion != 0.0:
                for i in range(count):
                    out[3 * i + axis] -= coupling.harmonic[i, p] * motion
