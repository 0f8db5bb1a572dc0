# SPDX-License-Identifier: Apache-2.0
"""Factors in a band and sparse, and the order that makes the band narrow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sparse

from gdfe_ros.mesh import bar
from gdfe_ros.solver.tangent import factor as module
from gdfe_ros.solver.tangent.factor import Factor
from gdfe_ros.solver.tangent.ordering import narrow_order

Make = Callable[..., tuple[sparse.csr_matrix, Factor]]


def _graph(cells: tuple[int, int, int]) -> tuple[sparse.csr_matrix, np.ndarray]:
    mesh = bar([float(n) for n in cells], list(cells))
    rows, columns = np.repeat(mesh.cells, 8, axis=1).ravel(), np.tile(mesh.cells, (1, 8)).ravel()
    count = len(mesh.vertices)
    return sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count)), mesh.vertices


@pytest.fixture(params=[10**9, 0], ids=["band", "sparse"])
def make(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Make:
    """Make a matrix of a bar and what factors it, in a band and sparse."""
    monkeypatch.setattr(module, "BROADEST", request.param)

    def of(*cells: int) -> tuple[sparse.csr_matrix, Factor]:
        graph, points = _graph(cells)
        matrix = (graph + 100.0 * sparse.identity(graph.shape[0])).tocsr()
        matrix.sort_indices()
        return matrix, Factor(matrix, narrow_order(graph, points))

    return of


def test_it_solves(make: Make) -> None:
    """Solve for one and for three right-hand sides."""
    matrix, found = make(12, 2, 2)
    assert found.factor(matrix)
    right = np.random.default_rng(0).standard_normal((matrix.shape[0], 3))
    np.testing.assert_allclose(matrix @ found.solve(right), right, atol=1e-10)
    np.testing.assert_allclose(matrix @ found.solve(right[:, 0]), right[:, 0], atol=1e-10)
    np.testing.assert_array_equal(found.solve(right[:, 0]), found.solve(right[:, 0].copy()))


def test_what_is_not_definite_has_no_factor(make: Make) -> None:
    """Refuse an indefinite matrix, and take the next one."""
    matrix, found = make(4, 1, 1)
    assert not found.factor((matrix - 200.0 * sparse.identity(matrix.shape[0])).tocsr())
    assert found.factor(matrix)


def test_a_bar_is_as_narrow_as_its_cross_section() -> None:
    """In the order that is found, neighbours are at most a cross-section and a row and a vertex apart."""
    graph, points = _graph((30, 2, 3))
    order = narrow_order(graph, points)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    entries = graph.tocoo()
    assert np.abs(rank[entries.row] - rank[entries.col]).max() <= 12 + 4 + 1
