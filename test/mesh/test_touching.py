# SPDX-License-Identifier: Apache-2.0
"""The contact points of a skin: on the skin, as many as cells resolve, at sharp edges, on both sides of walls."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.contact_skin import touch_by_skin
from gdfe_ros.mesh.generators import bar
from gdfe_ros.mesh.meshing.voxels import CutCubes, fill_surface
from gdfe_ros.mesh.outside import carry_skin

RNG = np.random.default_rng(5)
RADIUS = 0.05


def lined(
    surface: trimesh.Trimesh, cell: float, cells: CutCubes = CutCubes.CUT, mesh: HexMesh | None = None
) -> HexMesh:
    """Return a mesh with contact points on a surface. Without a given mesh, the surface is filled with cells."""
    points, triangles = np.asarray(surface.vertices), np.asarray(surface.faces)
    mesh = mesh or fill_surface(points, triangles, cell=cell, cells=cells)
    skin = carry_skin(mesh.vertices, mesh.cells, points, triangles)
    return touch_by_skin(HexMesh(mesh.vertices, mesh.cells, filling=mesh.filling, skin=skin), points, triangles)


@pytest.mark.parametrize("cells", list(CutCubes))
def test_points_are_on_the_skin_and_no_more_than_vertices(cells: CutCubes) -> None:
    """A ball with a skin of 1280 or 5120 triangles has contact points on it, at most as many as surface vertices."""
    counts = []
    for detail in (3, 4):
        mesh = lined(trimesh.creation.icosphere(detail, RADIUS), RADIUS / 6.0, cells)
        at_rest = mesh.touching.at(mesh.vertices)
        np.testing.assert_allclose(np.linalg.norm(at_rest, axis=1), RADIUS, rtol=8e-3)
        assert 0.4 * len(np.unique(mesh.surface())) < len(at_rest) <= len(np.unique(mesh.surface()))
        matrix, shift = RNG.normal(size=(3, 3)), RNG.normal(size=3)
        np.testing.assert_allclose(
            mesh.touching.at(mesh.vertices @ matrix + shift), at_rest @ matrix + shift, atol=1e-12
        )
        counts.append(len(at_rest))
    assert counts[1] == pytest.approx(counts[0], rel=0.1)


def test_a_cylinder_reaches_to_its_radius_with_an_error_of_second_order() -> None:
    """The contact points of a cut cylinder reach to its radius, with an error of second order in the cell size."""
    rod = trimesh.creation.cylinder(RADIUS, 1.5 * RADIUS, sections=400)
    turn = np.linspace(0.0, 2.0 * np.pi, 720)
    views = np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
    misses = []
    for count in (6, 12):
        mesh = lined(rod, 2.0 * RADIUS / count)
        reach = (mesh.touching.at(mesh.vertices) @ views.T).max(axis=0) / RADIUS
        assert reach.max() < 1.0 + 1e-6
        misses.append(1.0 - reach.min())
    assert misses[0] < 0.03
    assert misses[0] / misses[1] > 3.0


def test_corners_and_edges_touch() -> None:
    """A box that no grid line bounds has contact points at its eight corners and along its edges."""
    size = np.array([0.10, 0.053, 0.047])
    mesh = lined(trimesh.creation.box(size), 0.01)
    places = mesh.touching.at(mesh.vertices)
    outer = (np.abs(np.abs(places) - 0.5 * size) < 1e-9).sum(axis=1)
    assert (outer == 3).sum() == 8
    assert (outer == 2).sum() > 4 * (10 + 5 + 4) * 0.6
    assert (outer > 0).all()


def test_both_sides_of_a_wall_touch() -> None:
    """A wall thinner than its cells has contact points on both sides and none in its middle."""
    half = 0.002
    mesh = lined(trimesh.creation.box((0.06, 0.06, 2.0 * half)), 0.005)
    across = mesh.touching.at(mesh.vertices)[:, 2]
    np.testing.assert_allclose(np.abs(across), half, atol=1e-9)
    assert (across > 0.0).sum() == pytest.approx((across < 0.0).sum(), rel=0.1)


def test_a_cavity_touches_whatever_way_its_wall_faces() -> None:
    """A thin hollow ball has the same contact points, on both shells, whichever direction its inner shell faces."""
    found = []
    for turned in ((), (1,)):
        walls = [trimesh.creation.icosphere(3, RADIUS), trimesh.creation.icosphere(3, 0.8 * RADIUS)]
        for number in turned:
            walls[number].invert()
        mesh = lined(trimesh.util.concatenate(walls), RADIUS / 5.0)
        found.append(np.linalg.norm(mesh.touching.at(mesh.vertices), axis=1))
    np.testing.assert_allclose(np.sort(found[1]), np.sort(found[0]), atol=1e-12)
    inside = found[0] < 0.9 * RADIUS
    assert inside.sum() > 0.4 * (~inside).sum()


def test_a_fine_part_of_a_graded_mesh_has_points_at_its_cells() -> None:
    """A bar with cells twice as long at one end has as many contact points as vertices."""
    mesh = bar([0.10, 0.02, 0.02], [20, 4, 4])
    share = mesh.vertices[:, 0] / 0.10
    graded = HexMesh(mesh.vertices - np.outer(0.04 * share * (1.0 - share), [1.0, 0.0, 0.0]), mesh.cells)
    box = trimesh.creation.box((0.10, 0.02, 0.02)).apply_translation([0.05, 0.0, 0.0])
    assert len(lined(box, 0.0, mesh=graded).touching.corners) == len(np.unique(graded.surface()))


def test_open_skins_and_skins_of_a_part_are_refused() -> None:
    """An open skin, and a skin of one end of a bar, are refused with the defect, the place and a remedy."""
    ball = trimesh.creation.icosphere(3, RADIUS)
    whole = lined(ball, RADIUS / 4.0)
    with pytest.raises(MeshError, match=r"needs a closed skin\. At 3 edges.*\(.*\) m; remedy: close the holes"):
        touch_by_skin(whole, np.asarray(ball.vertices), np.asarray(ball.faces)[1:])
    rod = bar([0.2, 0.02, 0.02], [20, 2, 2])
    end = trimesh.creation.box((0.02, 0.02, 0.02)).apply_translation([0.01, 0.0, 0.0])
    with pytest.raises(MeshError, match=r"\d+ cells at the boundary are left outside of the skin.*0.195.*whole body"):
        lined(end, 0.0, mesh=rod)


def test_a_skin_that_ends_before_its_body_is_refused() -> None:
    """A skin that ends 1.6 cells before its rod is refused, naming the last four cells; 1.4 cells are accepted."""
    rod = bar([0.2, 0.02, 0.02], [20, 2, 2])
    for short in (0.005, 0.014, 0.016):
        skin = trimesh.creation.box((0.2 - short, 0.02, 0.02)).apply_translation([0.1 - 0.5 * short, 0.0, 0.0])
        if short < 0.015:
            assert lined(skin, 0.0, mesh=rod).touching is not None
            continue
        with pytest.raises(MeshError, match=r" 4 cells at the boundary are left outside.*0.195.*0.011 m away.*whole"):
            lined(skin, 0.0, mesh=rod)


def test_a_skin_that_leaves_out_a_hollow_is_refused() -> None:
    """A skin without the inner surface of a wide hollow is refused with the cells around it."""
    block = bar([0.2, 0.2, 0.2], [14, 14, 14])
    hole = (np.abs(block.centroids - block.centroids.mean(axis=0)) < 0.04).all(axis=1)
    mesh = HexMesh(*used(block.vertices, block.cells[~hole]))
    skin = trimesh.creation.box((0.2, 0.2, 0.2)).apply_translation([0.1, 0.0, 0.0])
    with pytest.raises(MeshError, match=r" 216 cells at the boundary .*are far from it"):
        lined(skin, 0.0, mesh=mesh)


def used(vertices: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the used vertices, and the cells renumbered to them."""
    ids, local = np.unique(cells, return_inverse=True)
    return vertices[ids], local.reshape(-1, 8).astype(np.int32)


@pytest.mark.parametrize("share", [0.15, 0.4, 0.6, 0.9])
def test_every_vertex_that_carries_a_face_has_a_point_of_it(share: float) -> None:
    """In a box with partly filled outer cells, each vertex of the lower side has one contact point near it."""
    count, edge = np.array([4, 4, 3]), 0.01
    mesh = lined(trimesh.creation.box((count + 2.0 * share) * edge), edge)
    places = mesh.touching.at(mesh.vertices)
    low = places[places[:, 2] < -(0.5 * count[2] + share) * edge + 1e-9, :2]
    beside = np.unique(np.round(mesh.vertices[mesh.vertices[:, 2] < mesh.vertices[:, 2].min() + 1e-9, :2], 9), axis=0)
    wanted = np.clip(beside, *(sign * (0.5 * count[:2] + share) * edge for sign in (-1, 1)))
    assert len(low) == len(wanted)
    assert np.linalg.norm(low[:, None] - wanted, axis=2).min(axis=0).max() < 0.25 * edge


def test_a_tip_in_the_middle_of_a_cell_touches() -> None:
    """The tip of a pyramid between four vertices is a contact point."""
    cone = trimesh.creation.cone(0.02, 0.03, sections=4).apply_transform(np.diag([1.0, 1.0, -1.0, 1.0]))
    cone.invert()
    tip = cone.vertices[np.argmin(cone.vertices[:, 2])]
    mesh = lined(cone, 0.04 / 5.0)
    assert np.linalg.norm(mesh.touching.at(mesh.vertices) - tip, axis=1).min() < 1e-9
