# SPDX-License-Identifier: Apache-2.0
"""The number of cells across a body is independent of the order of cells and corners."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.mesh import bar
from gdfe_ros.mesh.cells.faces import cells_across
from gdfe_ros.mesh.cells.filling import CORNERS


def test_a_bar_is_as_many_cells_across_as_it_has() -> None:
    """A block of 5 x 3 x 2 cells has these counts along its axes."""
    mesh = bar([0.5, 0.3, 0.2], [5, 3, 2])
    across = cells_across(mesh.cells, np.zeros(mesh.n_cells, np.int32), np.ones(mesh.n_cells, bool))
    np.testing.assert_array_equal(across, np.tile([5, 3, 2], (30, 1)))


def test_every_cell_may_have_axes_of_its_own() -> None:
    """With each cell's axes permuted and the cells shuffled, the counts are the same three in another order."""
    random = np.random.default_rng(3)
    mesh = bar([0.5, 0.3, 0.2], [5, 3, 2])
    turned = []
    for cell in random.permutation(mesh.cells):
        axes = random.permutation(3)
        seen = CORNERS[:, axes]
        order = [int(np.flatnonzero((corner == CORNERS).all(axis=1))[0]) for corner in seen]
        turned.append(cell[order])
    across = cells_across(np.array(turned, np.int32), np.zeros(30, np.int32), np.ones(30, bool))
    np.testing.assert_array_equal(np.sort(across, axis=1), np.tile([2, 3, 5], (30, 1)))


def test_a_row_ends_where_the_material_does() -> None:
    """Where the lowest of three layers has another material, the layers count as one and two cells."""
    mesh = bar([0.2, 0.2, 0.3], [2, 2, 3])
    low = mesh.vertices[mesh.cells].mean(axis=1)[:, 2] < mesh.vertices[:, 2].min() + 0.1
    across = cells_across(mesh.cells, low.astype(np.int32), np.ones(12, bool))
    np.testing.assert_array_equal(across[low], np.tile([2, 2, 1], (4, 1)))
    np.testing.assert_array_equal(across[~low], np.tile([2, 2, 2], (8, 1)))


@pytest.mark.parametrize("around", [3, 8])
def test_a_ring_counts_its_cells_once(around: int) -> None:
    """In a ring of cells the count along the ring is its number of cells, and one across."""
    mesh = bar([1.0, 0.1, 0.1], [around, 1, 1])
    column = np.rint((mesh.vertices[:, 0] - mesh.vertices[:, 0].min()) * around).astype(int) % around
    places = np.column_stack([column, mesh.vertices[:, 1:]])
    _, same = np.unique(places, axis=0, return_inverse=True)
    across = cells_across(same.ravel()[mesh.cells].astype(np.int32), np.zeros(around, np.int32), np.ones(around, bool))
    np.testing.assert_array_equal(across, np.tile([around, 1, 1], (around, 1)))


def test_rows_with_a_bent_cell_are_not_counted() -> None:
    """With the first of 3 x 3 x 3 cells bent, its three rows have one cell across, and all other rows have three."""
    mesh, straight = bar([0.3, 0.3, 0.3], [3, 3, 3]), np.ones(27, bool)
    straight[0] = False
    across = cells_across(mesh.cells, np.zeros(27, np.int32), straight)
    np.testing.assert_array_equal(across[0], [1, 1, 1])
    assert (across == 1).sum() == 9
    assert (across == 3).sum() == 72
