# SPDX-License-Identifier: Apache-2.0
"""Selections by face, box, sphere, ids and sets, with their boundaries included."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, bar, select_cells, select_vertices
from gdfe_ros.mesh.selection import BoxSelection, Side, SphereSelection, Where

MESH = bar([0.3, 0.1, 0.1], [3, 2, 1])


@pytest.mark.parametrize("side", Side)
def test_face_selects_exactly_the_vertices_of_one_side(side: Side) -> None:
    """A face selects exactly the vertices with the extreme coordinate."""
    axis, end = "xyz".index(side.value[0]), int(side.value[1] == "+")
    expected = np.flatnonzero(MESH.vertices[:, axis] == MESH.bounds[end, axis])
    ids = select_vertices(MESH, Where(face=side))
    np.testing.assert_array_equal(ids, expected)
    assert ids.dtype == np.int32


def test_face_selects_the_cells_that_touch_it() -> None:
    """The face x+ selects the last layer of cells."""
    assert select_cells(MESH, Where(face=Side.X_HIGH)).tolist() == [2, 5]


def test_box_is_closed_in_spite_of_rounding() -> None:
    """A vertex at x = 3 * 0.1 is in a box that ends at 0.3, and in one that starts there."""
    mesh = bar([0.9, 0.1, 0.1], [9, 1, 1])
    assert len(select_vertices(mesh, Where(box=BoxSelection(x=(0.3, 0.3))))) == 4
    assert len(select_vertices(mesh, Where(box=BoxSelection(x=(0.1 + 0.2, 0.9))))) == 7 * 4


def test_box_tests_cell_centroids() -> None:
    """A box selects the cells whose centroid is inside, wherever their corners are."""
    assert select_cells(MESH, Where(box=BoxSelection(x=(0.0, 0.16)))).tolist() == [0, 1, 3, 4]
    assert select_cells(MESH, Where(box=BoxSelection(x=(0.0, 0.16), y=(0.0, 1.0)))).tolist() == [3, 4]


def test_sphere_selects_by_distance() -> None:
    """A sphere selects the vertex at its centre and the neighbours at exactly its radius."""
    assert select_vertices(MESH, Where(sphere=SphereSelection((0.1, 0.0, 0.05), 0.01))).tolist() == [17]
    assert select_vertices(MESH, Where(sphere=SphereSelection((0.1, 0.0, 0.05), 0.1))).tolist() == [
        5,
        13,
        16,
        17,
        18,
        21,
    ]


def test_ids_are_sorted_and_unique() -> None:
    """Ids in any order are returned sorted and unique."""
    assert select_vertices(MESH, Where(vertices=(5, 1, 5))).tolist() == [1, 5]
    assert select_cells(MESH, Where(cells=(4, 0))).tolist() == [0, 4]


def test_cells_and_vertices_turn_into_each_other() -> None:
    """A cell selects its corners as vertices, and its corners select that cell."""
    corners = select_vertices(MESH, Where(cells=(1,)))
    assert corners.tolist() == sorted(MESH.cells[1].tolist())
    assert select_cells(MESH, Where(vertices=tuple(corners))).tolist() == [1]


def test_sets_of_the_mesh_are_found_by_name() -> None:
    """A named cell set selects vertices too, and a vertex set cells."""
    mesh = HexMesh(MESH.vertices, MESH.cells, {"soft": np.array([2])}, {"grip": MESH.cells[0]})
    assert select_cells(mesh, Where(set="soft")).tolist() == [2]
    assert select_vertices(mesh, Where(set="soft")).tolist() == sorted(MESH.cells[2].tolist())
    assert select_vertices(mesh, Where(set="grip")).tolist() == sorted(MESH.cells[0].tolist())
    assert select_cells(mesh, Where(set="grip")).tolist() == [0]


def test_unknown_sets_and_ids_are_named() -> None:
    """An unknown set or id is refused with the existing ones."""
    with pytest.raises(MeshError, match=r"vertex ids \[24, 99\] do not exist; allowed: 0 to 23"):
        select_vertices(MESH, Where(vertices=(1, 24, 99)))
    with pytest.raises(MeshError, match=r"cell ids \[6\]"):
        select_cells(MESH, Where(cells=(6,)))
    with pytest.raises(MeshError, match=r"set 'x' does not exist"):
        select_cells(MESH, Where(set="x"))


def test_nothing_there_is_an_empty_selection() -> None:
    """A selection without a match returns no ids and raises nothing."""
    assert select_vertices(MESH, Where(box=BoxSelection(x=(1.0, 2.0)))).size == 0
