# SPDX-License-Identifier: Apache-2.0
"""The constant matrix: symmetric, semi-definite, sliding handles eliminated."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.constraints import Axis, Handle
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.cells.operators import shape_operators
from gdfe_ros.paper.relative import assemble_centring
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix, apply_inverse, assemble
from gdfe_ros.solver.matrix.unknowns import Unknowns, number_unknowns

End = Callable[[HexMesh, str], NDArray[np.int32]]
MESH = bar([0.4, 0.1, 0.1], [8, 2, 2])
SHAPE = shape_operators(MESH.vertices, MESH.cells)


def stiffness() -> sparse.csc_matrix:
    """Assemble the matrix of a bar whose left half is 100 times stiffer than its right half."""
    weight = np.where(MESH.centroids[:, 0] < 0.2, 1e7, 1e5)
    return assemble(SHAPE, weight, 0.05 * weight)


@pytest.mark.parametrize("matrix", [stiffness(), assemble_centring(SHAPE)], ids=["energy", "relative"])
def test_matrix_is_symmetric_and_positive(matrix: sparse.csc_matrix) -> None:
    """The matrix has one zero eigenvalue, for a uniform translation, and positive others."""
    dense = matrix.toarray()
    np.testing.assert_allclose(dense, dense.T, atol=1e-12 * np.abs(dense).max())
    np.testing.assert_allclose(dense @ np.ones(len(dense)), 0.0, atol=1e-12 * np.abs(dense).max())
    values = np.linalg.eigvalsh(dense)
    assert abs(values[0]) < 1e-12 * values[-1]
    assert values[1] > 1e-6 * values[-1]


def test_centring_matrix_is_the_papers(end: End) -> None:
    """One element's centring matrix is its volume times N: 7/8 on the diagonal, -1/8 elsewhere (Sec. 3.1)."""
    mesh = bar([0.2, 0.1, 0.3], [1, 1, 1])
    matrix = assemble_centring(shape_operators(mesh.vertices, mesh.cells)).toarray()
    np.testing.assert_allclose(matrix, 0.006 * (np.eye(8) - 0.125), rtol=1e-12)


def test_turning_handles_are_eliminated(end: End) -> None:
    """With a handle that turns about two axes and slides along one, the solution is that of one dense system."""
    tip = Handle("tip", end(MESH, "x+"), free=(Axis.X,), turning=(Axis.Y, Axis.Z))
    unknowns = number_unknowns(MESH.vertices, MESH.cells, [Handle("base", end(MESH, "x-"), fixed=True), tip])
    matrix = stiffness()
    constant = ConstantMatrix(matrix, MESH.vertices, unknowns)
    right = np.random.default_rng(0).normal(size=(unknowns.rows, 3))
    right[-2:] *= np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
    found = solve(constant, right, unknowns)
    count, n = len(unknowns.free), MESH.n_vertices
    motions = np.zeros((n, 3, 3 * count + 3))
    for axis in range(3):
        motions[unknowns.free, axis, 3 * np.arange(count) + axis] = 1.0
    arms = (MESH.vertices[tip.vertices] - tip.centre(MESH.vertices)) / unknowns.radius[0]
    motions[tip.vertices, 0, -3] = 1.0
    motions[tip.vertices, :, -2] = np.cross([0.0, 1.0, 0.0], arms)
    motions[tip.vertices, :, -1] = np.cross([0.0, 0.0, 1.0], arms)
    full = sum(motions[:, axis].T @ (matrix @ motions[:, axis]) for axis in range(3))
    rows = np.concatenate([np.arange(3 * count), 3 * count + np.array([0, 4, 5])])
    expected = np.zeros(right.size)
    expected[rows] = np.linalg.solve(full, right.ravel()[rows])
    np.testing.assert_allclose(found.ravel(), expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_harmonic_predictor_stays_between_the_handles(end: End) -> None:
    """With one end held and the other lifted, the predictor lifts each vertex in proportion to its x."""
    handles = [Handle("base", end(MESH, "x-"), fixed=True), Handle("tip", end(MESH, "x+"))]
    unknowns = number_unknowns(MESH.vertices, MESH.cells, handles)
    motion = np.repeat([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], 9, axis=0)
    spread = ConstantMatrix(assemble(SHAPE, np.ones(32), np.full(32, 0.005)), MESH.vertices, unknowns).extend(motion)
    np.testing.assert_allclose(spread[:, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(spread[:, 2], MESH.vertices[unknowns.free, 0] / 0.4, atol=1e-9)


def solve(matrix: ConstantMatrix, right: NDArray[np.float64], unknowns: Unknowns) -> NDArray[np.float64]:
    """Solve for all rows, in compiled code."""
    out = np.zeros_like(right)
    apply_inverse(right.ravel(), matrix.coupling, out.ravel())
    return out
