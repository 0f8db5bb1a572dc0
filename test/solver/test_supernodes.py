# SPDX-License-Identifier: Apache-2.0
"""The supernodal factor of the constant matrix: exact for any shape, in single and in double precision."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.cells.operators import shape_operators
from gdfe_ros.mesh.generators import sphere
from gdfe_ros.solver.matrix import constant_matrix as factors
from gdfe_ros.solver.matrix.constant_matrix import Factor, assemble
from gdfe_ros.solver.matrix.elimination import dissect, find_elimination, narrow_orders

MESHES = {
    "bar": bar([1.0, 0.2, 0.2], [30, 6, 6]),
    "cube": bar([1.0, 1.0, 1.0], [9, 9, 9]),
    "plate": bar([1.0, 1.0, 0.05], [25, 25, 1]),
    "ball": sphere(0.5, 1.0, [6, 4]),
    "row": bar([1.0, 0.1, 0.1], [300, 1, 1]),
    "cell": bar([1.0, 1.0, 1.0], [1, 1, 1]),
}


def stiffness(mesh: HexMesh, *, contrast: float = 1.0, springs: float = 1e-3) -> sparse.csc_matrix:
    """Return the matrix of a mesh with ``springs`` at all vertices; half of its cells are stiffer by ``contrast``."""
    count = len(mesh.cells)
    weight = np.where(np.arange(count) < count // 2, contrast, 1.0)
    matrix = assemble(shape_operators(mesh.vertices, mesh.cells), weight, 0.1 * weight)
    return (matrix + springs * sparse.eye_array(mesh.n_vertices) * matrix.diagonal().max()).tocsc()


def right_of(mesh: HexMesh) -> NDArray[np.float64]:
    """Return three right-hand sides for a mesh."""
    return np.random.default_rng(3).normal(size=(mesh.n_vertices, 3))


def solved(factor: Factor, right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the solution by a factor."""
    out = np.empty_like(right)
    factor.solve(right, out)
    return out


@pytest.mark.parametrize("coarse_from", [1, 10**9], ids=["single", "double"])
@pytest.mark.parametrize("name", MESHES)
def test_it_solves(name: str, coarse_from: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a thousandfold contrast and the factor in either precision, the solution is SuperLU's to 1e-9."""
    monkeypatch.setattr(factors.Factor, "COARSE_FROM", coarse_from)
    mesh = MESHES[name]
    matrix, right = stiffness(mesh, contrast=1e3), right_of(mesh)
    factor = Factor(matrix, mesh.vertices)
    assert (factor.inverse.values.dtype == np.float32) == (coarse_from == 1)
    wanted = spsolve(matrix, right)
    np.testing.assert_allclose(solved(factor, right), wanted, atol=1e-9 * np.abs(wanted).max())


def test_pieces_that_nothing_joins_are_solved_each() -> None:
    """Disconnected bodies, and a vertex of its own, are solved as each alone."""
    mesh = MESHES["bar"]
    one = stiffness(mesh)
    both = sparse.block_diag([one, one, [[2.0]]]).tocsc()
    points = np.concatenate([mesh.vertices, mesh.vertices + np.array([0.0, 3.0, 0.0]), [[9.0, 9.0, 9.0]]])
    right = right_of(mesh)
    found = solved(Factor(both, points), np.concatenate([right, 2.0 * right, [[2.0] * 3]]))
    wanted = spsolve(one, right)
    np.testing.assert_allclose(found, np.concatenate([wanted, 2.0 * wanted, [[1.0] * 3]]), rtol=1e-8, atol=1e-12)


def test_a_matrix_that_is_not_definite_is_regularised() -> None:
    """A singular matrix, of a body that nothing holds, has a finite inverse that solves for forces in balance."""
    mesh = MESHES["bar"]
    matrix = stiffness(mesh, springs=0.0)
    right = right_of(mesh)
    right -= right.mean(axis=0)
    found = solved(Factor(matrix, mesh.vertices), right)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(matrix @ found, right, atol=1e-3 * np.abs(right).max())


def test_the_same_bits_in_every_thread() -> None:
    """Solving in four threads with one factor gives the same bits."""
    mesh = MESHES["cube"]
    factor = Factor(stiffness(mesh), mesh.vertices)
    right = right_of(mesh)
    alone = solved(factor, right)
    with ThreadPoolExecutor(4) as pool:
        assert all(np.array_equal(found, alone) for found in pool.map(lambda _: solved(factor, right), range(40)))


def test_dissection_fills_less_where_a_body_is_thick() -> None:
    """For a cube of 15 cells per edge, nested dissection has at most 0.8 of the narrow order's entries."""
    mesh = bar([1.0, 1.0, 1.0], [15, 15, 15])
    graph = stiffness(mesh).tocsr()
    kinds = narrow_orders(graph, mesh.vertices), [dissect(graph, mesh.vertices)]
    narrow, halves = (find_elimination(graph, orders).entries for orders in kinds)
    assert halves < 0.8 * narrow


def test_points_at_one_place_are_no_obstacle() -> None:
    """Nested dissection orders vertices that all lie at one point."""
    graph = stiffness(MESHES["bar"]).tocsr()
    order = dissect(graph, np.zeros((graph.shape[0], 3)))
    np.testing.assert_array_equal(np.sort(order), np.arange(graph.shape[0]))
