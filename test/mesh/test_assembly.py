# SPDX-License-Identifier: Apache-2.0
"""Several meshes are joined to one, and positions are given in the frame of one of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, bar, check_mesh, select_cells, select_faces, select_vertices
from gdfe_ros.mesh.assembly import assemble
from gdfe_ros.mesh.cells.filling import Filling
from gdfe_ros.mesh.mesh import MeshPart
from gdfe_ros.mesh.outside import carry_skin
from gdfe_ros.mesh.selection import BoxSelection, Side, Where

BAR = replace(bar([4, 1, 1], [4, 1, 1]), cell_sets={"ends": np.array([0, 3])}, vertex_sets={"left": np.array([0, 5])})
BLOCK, RIGHT = bar([2, 2, 2], [2, 2, 2]), np.array([1.0, 0.0, 0.0])
TURN = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix()


def pair(**changes: HexMesh) -> HexMesh:
    """Return a bar that is rotated and moved, joined with a block that is moved."""
    meshes = {"bar": BAR, "block": BLOCK} | changes
    return assemble(
        {
            "bar": MeshPart(meshes["bar"], np.array([0.0, 5.0, 0.0]), TURN),
            "block": MeshPart(meshes["block"], RIGHT, np.eye(3)),
        }
    )


def test_each_is_where_it_was_put() -> None:
    """The joined mesh has the parts' coordinates, cells, sets and pieces in the order of the parts."""
    mesh, report = pair(), check_mesh(pair())
    assert (report.parts, report.defects, report.volume) == (2, [], pytest.approx(12.0))
    np.testing.assert_allclose(mesh.vertices[: BAR.n_vertices], BAR.vertices @ TURN.T + [0.0, 5.0, 0.0])
    np.testing.assert_array_equal(mesh.vertices[BAR.n_vertices :], BLOCK.vertices + RIGHT)
    np.testing.assert_array_equal(mesh.cells[BAR.n_cells :], BLOCK.cells + BAR.n_vertices)
    assert (mesh.cell_sets["ends"].tolist(), mesh.parts["block"].first_cell) == ([0, 3], BAR.n_cells)
    assert mesh.size == BAR.size < mesh.extent


def test_vertices_at_one_place_stay_apart() -> None:
    """Two blocks face to face keep separate vertices and surfaces."""
    mesh = assemble({name: MeshPart(BLOCK, np.array([x, 0.0, 0.0]), np.eye(3)) for name, x in (("a", 0.0), ("b", 2.0))})
    assert (mesh.n_vertices, len(mesh.surface())) == (2 * BLOCK.n_vertices, 2 * len(BLOCK.surface()))


def test_places_are_those_of_the_mesh_that_is_named() -> None:
    """Selections within a named mesh use its frame, ids and sets; others use the world's frame and the whole mesh's."""
    mesh, first = pair(), BAR.n_vertices
    for where in (
        Where(face=Side.X_LOW),
        Where(box=BoxSelection(x=(0.0, 1.0))),
        Where(vertices=(3, 1)),
        Where(cells=(2,)),
        Where(set="left"),
    ):
        np.testing.assert_array_equal(select_vertices(mesh, replace(where, mesh="bar")), select_vertices(BAR, where))
        np.testing.assert_array_equal(select_cells(mesh, replace(where, mesh="bar")), select_cells(BAR, where))
    inner = Where(face=Side.Z_HIGH)
    np.testing.assert_array_equal(
        select_vertices(mesh, replace(inner, mesh="block")), select_vertices(BLOCK, inner) + first
    )
    np.testing.assert_array_equal(select_faces(mesh, replace(inner, mesh="block")), select_faces(BLOCK, inner) + first)
    np.testing.assert_array_equal(select_cells(mesh, Where(mesh="block")), np.arange(BLOCK.n_cells) + BAR.n_cells)
    np.testing.assert_array_equal(select_vertices(mesh, Where(set="left")), BAR.vertex_sets["left"])
    assert set(select_vertices(mesh, Where(face=Side.Y_LOW))) <= set(range(first, mesh.n_vertices))


def test_an_unknown_mesh_or_set_is_named() -> None:
    """An unknown mesh, a mesh name for a single mesh, and a set of another mesh are refused by name."""
    with pytest.raises(MeshError, match="mesh 'bra' does not exist; there are: bar, block"):
        select_vertices(pair(), Where(mesh="bra"))
    with pytest.raises(MeshError, match="mesh 'bar' does not exist; there is one mesh, which has no name"):
        select_cells(BAR, Where(mesh="bar", cells=(0,)))
    with pytest.raises(MeshError, match="set 'left' does not exist"):
        select_vertices(pair(), Where(mesh="block", set="left"))


def test_a_filling_stays_with_its_cells() -> None:
    """The filling of cut cells is kept in a mesh joined with whole cells."""
    share = np.array([0.5, 1.0, 1.0, 0.25])
    cut = replace(BAR, filling=Filling(share, np.full((4, 3), 0.1), np.full((4, 3), 0.5)))
    filling = pair(bar=cut).filling
    np.testing.assert_array_equal(filling.share, [*share, *np.ones(BLOCK.n_cells)])
    assert filling.cut.tolist() == [0, 1, 2, 3]
    assert pair().filling is None


def test_a_skin_is_shown_beside_faces() -> None:
    """With a skin on one of two meshes, the skin and the other mesh's faces are drawn at their vertices."""
    points = np.array([[0.0, 0.0, 0.6], [4.0, 0.0, 0.6], [4.0, 0.4, 0.6]])
    skinned = replace(BAR, skin=carry_skin(BAR.vertices, BAR.cells, points, np.array([[0, 1, 2]])))
    mesh = pair(bar=skinned)
    outside, count = mesh.outside, len(skinned.skin.corners)
    shown = outside.at(mesh.vertices)
    np.testing.assert_allclose(shown[:count], skinned.skin.at(BAR.vertices) @ TURN.T + [0, 5, 0], atol=1e-12)
    np.testing.assert_array_equal(shown[count:], BLOCK.outside.at(BLOCK.vertices) + RIGHT)
    corners = shown[outside.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(24.0 + 0.8)
    assert (outside.cells >= BAR.n_cells).sum() == 2 * len(BLOCK.surface())
