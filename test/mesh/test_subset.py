# SPDX-License-Identifier: Apache-2.0
"""Meshes are cut, joined and merged with their sets."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, bar, check_mesh, select_cells
from gdfe_ros.mesh.assembly import join, keep_cells, merge_vertices
from gdfe_ros.mesh.generators import cut
from gdfe_ros.mesh.selection import BoxSelection, Where

BAR = bar([4, 1, 1], [4, 1, 1])
NAMED = HexMesh(BAR.vertices, BAR.cells, {"ends": np.array([0, 3])}, {"left": np.array([0, 5, 10, 15])})


def test_keeping_cells_renumbers_sets() -> None:
    """Without the first cell, its vertices are removed and the sets are renumbered."""
    mesh = keep_cells(NAMED, np.array([False, True, True, True]))
    assert mesh.n_vertices == 16
    assert mesh.cell_sets["ends"].tolist() == [2]
    assert mesh.vertex_sets["left"].tolist() == []
    np.testing.assert_array_equal(mesh.vertices[mesh.cells], NAMED.vertices[NAMED.cells[1:]])


def test_joined_and_sewn_bars_are_one_bar() -> None:
    """Two bars, joined end to end and merged, have the volume, the parts and the number of vertices of one."""
    moved = HexMesh(NAMED.vertices + np.array([4, 0, 0]), NAMED.cells, NAMED.cell_sets, NAMED.vertex_sets)
    both = join(NAMED, moved)
    assert check_mesh(both).parts == 2
    sewn = merge_vertices(both)
    report = check_mesh(sewn)
    assert report.defects == []
    assert report.parts == 1
    assert sewn.n_vertices == 2 * 20 - 4
    assert sewn.cell_sets["ends"].tolist() == [0, 3, 4, 7]
    np.testing.assert_array_equal(np.sort(sewn.vertices[sewn.vertex_sets["left"], 0]), [0, 0, 0, 0, 4, 4, 4, 4])


def test_merging_keeps_the_first_of_a_group_and_the_order() -> None:
    """Merging leaves a mesh without duplicates unchanged, and makes one mesh of three equal ones."""
    same = merge_vertices(BAR)
    np.testing.assert_array_equal(same.vertices, BAR.vertices)
    np.testing.assert_array_equal(same.cells, BAR.cells)
    triple = merge_vertices(join(BAR, BAR, BAR))
    np.testing.assert_array_equal(triple.vertices, BAR.vertices)


def test_cuts_take_the_cells_of_their_boxes() -> None:
    """A cut removes the cells in its box; a cut that removes none, or all, is refused."""
    body = cut(BAR, [Where(box=BoxSelection(x=(1, 2))), Where(box=BoxSelection(x=(3, 4)))])
    np.testing.assert_allclose(body.centroids[:, 0], [0.5, 2.5])
    assert select_cells(body, Where(box=BoxSelection(x=(1, 2)))).size == 0
    with pytest.raises(MeshError, match=r"cut 1 .*removes no cell"):
        cut(BAR, [Where(box=BoxSelection(x=(1, 2))), Where(box=BoxSelection(x=(9, 10)))])
    with pytest.raises(MeshError, match=r"leave no cell"):
        cut(BAR, [Where(box=BoxSelection(x=(0, 4)))])
