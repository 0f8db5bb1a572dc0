# SPDX-License-Identifier: Apache-2.0
"""Supernodal factors, and elimination orders that keep them small."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.mesh import bar
from gdfe_ros.solver.matrix.fronts import Fronts, unturned_solutions


def _graph(cells: NDArray[np.int32], count: int) -> sparse.csr_matrix:
    rows, columns = np.repeat(cells, 8, axis=1).ravel(), np.tile(cells, (1, 8)).ravel()
    graph = sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count)).tocsr()
    graph.sort_indices()
    return graph


def _bar(*cells: int) -> tuple[sparse.csr_matrix, NDArray[np.float64]]:
    mesh = bar([float(n) for n in cells], list(cells))
    return _graph(mesh.cells, len(mesh.vertices)), mesh.vertices


def _hand(fingers: int, length: int) -> tuple[sparse.csr_matrix, NDArray[np.float64]]:
    """Return the graph and the vertices of a palm with fingers of two cells across."""
    palm = bar([4.0 * fingers, 2.0, 2.0], [4 * fingers, 2, 2])
    parts, points, count = [palm.cells], [palm.vertices], len(palm.vertices)
    for number in range(fingers):
        finger = bar([2.0, 2.0, float(length)], [2, 2, length])
        parts.append(finger.cells + count)
        points.append(finger.vertices + np.array([4.0 * number, 0.0, 2.0]))
        count += len(finger.vertices)
    places, same = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    return _graph(same[np.concatenate(parts)], len(places)), places


def _blocks(graph: sparse.csr_matrix, *, least: float = 30.0) -> NDArray[np.float64]:
    """Return blocks (k, 3, 3) of a symmetric matrix on a graph; it is positive definite unless ``least`` is small."""
    generator = np.random.default_rng(0)
    half = sparse.bsr_matrix(
        (generator.standard_normal((len(graph.indices), 3, 3)), graph.indices, graph.indptr),
        shape=(3 * graph.shape[0], 3 * graph.shape[0]),
    )
    whole = (0.05 * (half + half.T) + least * sparse.identity(half.shape[0])).tobsr((3, 3))
    whole.sort_indices()
    assert np.array_equal(whole.indices, graph.indices)
    return whole.data


def _matrix(graph: sparse.csr_matrix, blocks: NDArray[np.float64]) -> NDArray[np.float64]:
    size = 3 * graph.shape[0]
    return sparse.bsr_matrix((blocks, graph.indices, graph.indptr), shape=(size, size)).toarray()


@pytest.mark.parametrize(
    "body", [_bar(1, 1, 1), _bar(12, 2, 2), _bar(6, 5, 5), _hand(3, 6)], ids=["cell", "bar", "block", "hand"]
)
def test_it_solves(body: tuple[sparse.csr_matrix, NDArray[np.float64]]) -> None:
    """A factor gives, to its rounding, the solution of a dense solver for one and for three right-hand sides."""
    graph, points = body
    found, blocks = Fronts(graph, points), _blocks(graph)
    assert found.factor(blocks)
    right = np.random.default_rng(1).standard_normal((3 * len(points), 3))
    expected = np.linalg.solve(_matrix(graph, blocks), right)
    solutions = unturned_solutions(found.kept, right)
    np.testing.assert_allclose(solutions, expected, atol=1e-6)
    np.testing.assert_array_equal(unturned_solutions(found.kept, right[:, :1]), solutions[:, :1])


def test_a_factor_that_is_kept_in_single_precision_has_the_soft_modes() -> None:
    """A matrix with a condition number of 1e9 is solved to 1 %, because its factor is computed in double precision."""
    graph, points = _bar(6, 5, 5)
    found, soft = Fronts(graph, points), np.linalg.eigvalsh(_matrix(graph, _blocks(graph, least=0.0)))
    blocks = _blocks(graph, least=-soft[0] + 1e-9 * (soft[-1] - soft[0]))
    right = np.random.default_rng(1).standard_normal((3 * len(points), 1))
    expected = np.linalg.solve(_matrix(graph, blocks), right)
    assert found.factor(blocks)
    assert found.kept.values.dtype == np.float32
    np.testing.assert_allclose(unturned_solutions(found.kept, right), expected, atol=0.01 * np.abs(expected).max())


def test_what_is_not_definite_has_no_factor() -> None:
    """An indefinite matrix and a matrix of NaN are refused, and a positive definite one is factored afterwards."""
    graph, points = _hand(2, 3)
    found, blocks = Fronts(graph, points), _blocks(graph)
    assert not found.factor(_blocks(graph, least=-30.0))
    assert not found.factor(np.full_like(blocks, np.nan))
    assert found.factor(blocks)


def test_a_factor_is_the_same_to_the_last_bit() -> None:
    """A matrix has the same factor to the last bit in another object that has factored another matrix before."""
    graph, points = _hand(2, 4)
    blocks, right = _blocks(graph), np.linspace(-1.0, 1.0, 3 * len(points))[:, None]
    first, second = Fronts(graph, points), Fronts(graph, points)
    assert first.factor(blocks)
    answer = unturned_solutions(first.kept, right)
    assert second.factor(_blocks(graph, least=40.0))
    assert second.factor(blocks)
    np.testing.assert_array_equal(unturned_solutions(second.kept, right), answer)
