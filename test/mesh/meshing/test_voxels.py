# SPDX-License-Identifier: Apache-2.0
"""Meshes of whole and of cut cubes from closed surfaces."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros.actuators.load import corner_volumes
from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import check_mesh
from gdfe_ros.mesh.cavities import find_cavities
from gdfe_ros.mesh.cells.filling import CORNERS, MODES, Filling
from gdfe_ros.mesh.cells.operators import shape_operators
from gdfe_ros.mesh.mesh import HexMesh
from gdfe_ros.mesh.meshing.voxels import (
    LEAST_SHARE,
    CutCubes,
    cube_moments,
    examine_surface,
    fill_surface,
    gather_slivers,
    read_voxels,
)
from gdfe_ros.mesh.surfaces.shells import inside, points_inside, shells
from gdfe_ros.mesh.surfaces.surface_edges import winding_defects
from gdfe_ros.solver.motion.inertia import mass_matrix

BOX = trimesh.creation.box((0.1, 0.06, 0.04))
BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.012)
HOLLOW = trimesh.util.concatenate([BOX, BALL])


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off"])
def test_a_box_is_filled_exactly(tmp_path: Path, suffix: str) -> None:
    """A box of 0.1 x 0.06 x 0.04 is filled exactly with cubes of 0.01."""
    BOX.export(tmp_path / f"box.{suffix}")
    mesh = read_voxels(tmp_path / f"box.{suffix}", cell=0.01)
    assert mesh.n_cells == 10 * 6 * 4
    np.testing.assert_allclose(mesh.bounds, BOX.bounds, atol=1e-9)
    assert check_mesh(mesh).defects == []
    assert (np.diff(mesh.centroids[:10, 0]) > 0).all()


@pytest.mark.parametrize("flip", [False, True])
def test_a_cavity_is_kept_whatever_its_orientation(flip: bool) -> None:
    """A ball-shaped cavity in a box is kept with its triangles facing in or out."""
    ball = BALL.copy()
    if flip:
        ball.invert()
    hollow = trimesh.util.concatenate([BOX, ball])
    mesh = fill_surface(hollow.vertices, hollow.faces, cell=0.002)
    (cavity,) = find_cavities(mesh)
    assert cavity.volume == pytest.approx(BALL.volume, rel=0.03)
    np.testing.assert_allclose(cavity.center, 0, atol=1e-9)
    assert mesh.n_cells * 0.002**3 == pytest.approx(BOX.volume - cavity.volume)


def test_points_on_edges_and_corners_are_counted_once() -> None:
    """If columns pass through the triangles' vertices, edges and diagonals, exactly the inner points are found."""
    box = trimesh.creation.box((4, 4, 4)).apply_translation((4, 4, 4)).subdivide().subdivide()
    inside = points_inside(box.vertices - [0, 0, 0.5], box.faces, (9, 9, 9))
    assert inside.sum() == 4 * 4 * 4
    turned = box.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [4, 4, 4]))
    grid = np.stack(np.meshgrid(*[np.arange(9.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    own = (grid - 4) @ trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3]
    expected = (abs(own) < 2).all(axis=1).reshape(9, 9, 9)
    np.testing.assert_array_equal(points_inside(turned.vertices, turned.faces, (9, 9, 9)), expected)


def test_points_are_within_shells_whatever_way_these_face() -> None:
    """Points in a hollow ball, in its cavity and beside it are classified, whatever direction its inner shell faces."""
    points = np.array([[0.9, 0.0, 0.0], [0.2, 0.1, 0.0], [1.2, 0.0, 0.3], [0.0, 0.0, -0.8]])
    for turned in (False, True):
        inner = trimesh.creation.icosphere(2, 0.5)
        if turned:
            inner.invert()
        ball = trimesh.util.concatenate([trimesh.creation.icosphere(2, 1.0), inner])
        assert inside(points, np.asarray(ball.vertices), np.asarray(ball.faces)).tolist() == [True, False, False, True]


def test_shells_know_their_nesting() -> None:
    """For a ball in a cavity in a box, depths are 0, 1, 2, and the volume is that of the material."""
    core = trimesh.creation.icosphere(subdivisions=2, radius=0.005)
    nested = trimesh.util.concatenate([BOX, BALL, core])
    found = shells(nested.vertices, nested.faces)
    assert found.depths == (0, 1, 2)
    assert found.n_cavities == 1
    assert found.volume == pytest.approx(BOX.volume - BALL.volume + core.volume)


def write(mesh: trimesh.Trimesh, scale: float = 1.0) -> object:
    """Write a surface, scaled."""
    return lambda path: mesh.copy().apply_scale(scale).export(path)


def with_coordinate(value: float) -> object:
    """Write the box with one vertex that is not finite."""
    vertices = BOX.vertices.copy()
    vertices[0] = value
    return lambda path: trimesh.Trimesh(vertices, BOX.faces, process=False).export(path)


SHELL = trimesh.util.concatenate([BOX, BOX.copy().apply_scale(0.9)])
OPEN = BOX.copy()
OPEN.update_faces(np.arange(12) != 3)
BROKEN = [
    ("open.stl", write(OPEN), 0.01, r"the surface is open: 3 edges .*, the first at \(.*close the holes"),
    ("mm.stl", write(BOX, 1000), 0.01, r"diagonal is 123.* in mm: give `scale: 0.001`"),
    ("thin.stl", write(SHELL), 0.5, r"no cube's centre lies inside"),
    ("huge.stl", write(BOX), 0.5, r"the cubes have 52083% of the surface's volume"),
    ("coarse.stl", write(HOLLOW), 0.019, r"of 1 cavities 0 are left; remedy: a smaller cell"),
    ("fine.stl", write(BOX), 1e-6, r"gives 2.4e\+14 cubes; .*remedy: a cell of at least 0.00017 m"),
    ("text.stl", lambda path: path.write_text("no solid here"), 0.01, r"cannot be read as .stl|no triangles"),
    ("empty.obj", lambda path: path.write_text("v 0 0 0\n"), 0.01, r"no triangles|cannot be read as .obj"),
    ("body.step", lambda path: path.write_text("x"), 0.01, r"unknown kind of file '.step'; allowed: .stl, .obj"),
    ("none.stl", lambda path: None, 0.01, r"there is no such file"),
    ("folder.stl", lambda path: path.mkdir(), 0.01, r"this is a folder; remedy: the path of a file in it"),
    ("nan.stl", with_coordinate(np.nan), 0.01, r"12 coord.* first: x = nan of vertex 2 \(in triangle 0\).*remedy:"),
    ("inf.ply", with_coordinate(-np.inf), 0.01, r"3 coord.* first: x = -inf of vertex 0 \(in triangle 0\).*allowed:"),
    ("tinier.stl", write(BOX, 1e-30), 0.01, r"longest side is 1e-31 in the file's unit; allowed .* 1e-12 to 1e\+12"),
    ("huger.stl", write(BOX, 1e30), 0.01, r"longest side is 1e\+29 in the file's unit; allowed .* 1e-12 to 1e\+12"),
    ("point.obj", write(BOX, 0.0), 0.01, r"longest side is 0 in the file's unit"),
]


@pytest.mark.parametrize(("name", "make", "cell", "expected"), BROKEN)
def test_unfit_surfaces_get_clear_messages(tmp_path: Path, name: str, make: object, cell: float, expected: str) -> None:
    """An unfit surface is refused in one line with a remedy."""
    make(tmp_path / name)
    with pytest.raises(MeshError) as caught:
        read_voxels(tmp_path / name, cell=cell)
    assert any(re.search(expected, defect) for defect in caught.value.defects), caught.value
    assert str(tmp_path / name) in str(caught.value)


def test_a_surface_in_millimetres_is_scaled(tmp_path: Path) -> None:
    """A box of 100 mm is filled with cubes of 10 mm given in metres."""
    write(BOX, 1000)(tmp_path / "mm.stl")
    mesh = read_voxels(tmp_path / "mm.stl", cell=0.01, scale=0.001)
    np.testing.assert_allclose(mesh.bounds, BOX.bounds, atol=1e-9)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("suffix", ["stl", "ply"])
@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_vertices_are_merged_relative_to_the_size(tmp_path: Path, suffix: str, scale: float) -> None:
    """A box in an absurd unit keeps its eight vertices; the only defect is its unit."""
    write(BOX, scale)(tmp_path / f"box.{suffix}")
    vertices, triangles, defects = examine_surface(tmp_path / f"box.{suffix}")
    assert (len(vertices), len(triangles)) == (8, 12)
    assert winding_defects(vertices, triangles) == []
    (defect,) = defects
    assert "check its unit" in defect


def test_the_unit_is_told_first(tmp_path: Path) -> None:
    """An open box in millimetres has a defect for the unit, then one for the hole."""
    write(OPEN, 1000)(tmp_path / "open.stl")
    unit, hole = examine_surface(tmp_path / "open.stl")[2]
    assert "not in metres" in unit
    assert "the surface is open" in hole


def test_collapsed_triangles_are_left_out(tmp_path: Path) -> None:
    """A foil much thinner than single precision has no edges that are open or wound wrongly."""
    trimesh.creation.box((0.04, 0.04, 1e-11)).export(tmp_path / "foil.stl")
    vertices, triangles, defects = examine_surface(tmp_path / "foil.stl")
    assert defects + winding_defects(vertices, triangles) == []


def test_no_triangles_are_no_shells() -> None:
    """Without triangles, as for a skin of which no shell is closed, there are no shells, and no point is inside."""
    none = np.zeros((0, 3), dtype=np.int64)
    assert shells(BOX.vertices, none).depths == ()
    assert inside(np.zeros((0, 3)), BOX.vertices, BOX.faces).shape == (0,)


RANDOM = np.random.default_rng(5)


def inertia(mesh: HexMesh, edge: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Return volume, centroid and second moments about the origin of the material in cubic cells."""
    filling = mesh.filling
    volume = filling.share * edge**3
    centre = mesh.centroids + 0.5 * edge * filling.centre
    second = volume @ (centre**2 + (0.5 * edge * filling.spread) ** 2 / 3.0)
    return volume.sum(), volume @ centre / volume.sum(), second


@pytest.mark.parametrize("flip", [False, True])
def test_a_box_between_grid_lines_keeps_its_moments(flip: bool) -> None:
    """A cut box of 3.3 x 2.6 x 1.7 cubes has its own volume, centroid and second moments."""
    size = np.array([3.3, 2.6, 1.7])
    box = trimesh.creation.box(size)
    if flip:
        box.invert()
    mesh = fill_surface(box.vertices, box.faces, cell=1.0, cells=CutCubes.CUT)
    volume, centre, second = inertia(mesh, 1.0)
    assert volume == pytest.approx(size.prod(), rel=0.005)
    np.testing.assert_allclose(centre, 0.0, atol=2e-3)
    np.testing.assert_allclose(second, size.prod() * size**2 / 12.0, rtol=0.01)


def test_whole_cubes_within_a_cut_mesh_are_exactly_whole() -> None:
    """A box on grid lines has no cut cell, and its operators have the bits of whole cells."""
    box = trimesh.creation.box((0.03, 0.02, 0.02))
    cut = fill_surface(box.vertices, box.faces, cell=0.01, cells=CutCubes.CUT)
    whole = fill_surface(box.vertices, box.faces, cell=0.01)
    np.testing.assert_array_equal(cut.vertices, whole.vertices)
    np.testing.assert_array_equal(cut.cells, whole.cells)
    assert len(cut.filling.cut) == 0
    for found, wanted in zip(
        shape_operators(cut.vertices, cut.cells, cut.filling), shape_operators(cut.vertices, cut.cells), strict=True
    ):
        np.testing.assert_array_equal(found, wanted)


def test_a_wall_within_one_layer_of_cubes_keeps_its_thickness() -> None:
    """A block's outer layer that fills 0.74 of its cubes' edge, normal to each axis, has that filled fraction."""
    for axis in range(3):
        size = np.full(3, 4.0)
        size[axis] = 2.74
        block = trimesh.creation.box(size)
        low = np.full(3, 2.0)
        low[axis] = 1.63
        moments = cube_moments(block.vertices + low + 1e-9, block.faces, (4, 4, 4))
        inner = np.moveaxis(moments[:, 0].reshape(4, 4, 4), 2 - axis, 0)[:, 1:3, 1:3]
        np.testing.assert_allclose(
            inner, np.array([0.74, 1.0, 1.0, 0.0])[:, None, None] * np.ones((4, 2, 2)), atol=1e-6
        )


def test_slivers_move_to_the_cell_beside_them_with_all_their_moments() -> None:
    """A layer of 4 % of a cell is merged into its neighbour, which keeps the volume and the moments."""
    box = trimesh.creation.box((2.08, 1.0, 1.0))
    shifted = cube_moments(box.vertices + np.array([1.04, 0.5, 0.5]), box.faces, (3, 1, 1))
    assert 0.0 < shifted[2, 0] < LEAST_SHARE
    gathered = gather_slivers(shifted, (3, 1, 1))
    assert gathered[2, 0] == 0.0
    assert gathered[:, 0].sum() == pytest.approx(shifted[:, 0].sum(), rel=1e-12)
    place = np.array([-2.0, 0.0, 2.0])
    first, second = (m[:, 1] + place * m[:, 0] for m in (shifted, gathered))
    assert second.sum() == pytest.approx(first.sum(), rel=1e-12)
    first, second = (m[:, 4] + 2.0 * place * m[:, 1] + place**2 * m[:, 0] for m in (shifted, gathered))
    assert second.sum() == pytest.approx(first.sum(), rel=1e-12)


@pytest.mark.parametrize("axis", [0, 2])
def test_the_second_moment_of_a_circle_is_kept(axis: int) -> None:
    """A cut cylinder of 6 cells per diameter has its second moment within 0.5 %, along and across the columns."""
    body = trimesh.creation.cylinder(0.5, 2.0, sections=360)
    if axis == 0:
        body.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    mesh = fill_surface(body.vertices, body.faces, cell=1.0 / 6.0, cells=CutCubes.CUT)
    second = inertia(mesh, 1.0 / 6.0)[2]
    assert second[1] == pytest.approx(2.0 * np.pi / 4.0 * 0.5**4, rel=0.005)
    assert mesh.filling.share.min() >= LEAST_SHARE


def test_operators_of_a_cut_cell_are_those_of_its_box() -> None:
    """The operators of a skewed cut cell are those of the filled box in it, for a trilinear field."""
    corners = CORNERS @ np.array([[1.0, 0.2, 0.0], [0.0, 0.9, 0.1], [0.1, 0.0, 1.2]])
    cells = np.arange(8, dtype=np.int32)[None]
    filling = Filling(np.array([0.3]), np.array([[0.2, -0.4, 0.1]]), np.array([[0.7, 0.5, 0.8]]))
    found = shape_operators(corners, cells, filling)
    field = RANDOM.normal(size=(8, 3))
    weights = filling.boxes[0]
    box = shape_operators(weights @ corners, cells)
    np.testing.assert_allclose(field.T @ found.gradient[0], (weights @ field).T @ box.gradient[0], atol=1e-12)
    np.testing.assert_allclose(found.hourglass[0] @ field, box.hourglass[0] @ weights @ field, atol=1e-12)
    np.testing.assert_allclose(corners.T @ found.gradient[0], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(found.hourglass[0] @ np.column_stack([corners, np.ones(8)]), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.diag(MODES[:3] @ found.hourglass[0, :3].T), 8**0.5 * np.array([0.4, 0.56, 0.35]))
    assert found.volume[0] == pytest.approx(0.3 * 8.0 * np.linalg.det(corners[[1, 3, 4]] - corners[0]) / 8.0)
    assert not found.parallel[0]


def test_weight_and_mass_are_those_of_what_is_filled() -> None:
    """The corner volumes and mass matrix of a cut ball give its volume, centre of mass and moment of inertia."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    mesh = fill_surface(ball.vertices, ball.faces, cell=0.4, cells=CutCubes.CUT)
    share = corner_volumes(mesh.vertices, mesh.cells, mesh.filling)
    assert share.sum() == pytest.approx(ball.volume, rel=0.01)
    np.testing.assert_allclose(np.einsum("ea,eai->i", share, mesh.vertices[mesh.cells]), 0.0, atol=0.01)
    mass = mass_matrix(mesh.vertices, mesh.cells, np.full(mesh.n_cells, 3.0), filling=mesh.filling)
    x = mesh.vertices[:, 0]
    assert x @ (mass @ x) == pytest.approx(3.0 * 4.0 / 15.0 * np.pi, rel=0.02)


def test_a_cavity_that_cut_cells_close_is_named() -> None:
    """A cavity smaller than a cell has no empty cube: it is refused, with a smaller cell as remedy."""
    hollow = trimesh.util.concatenate([trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.15, 0.15, 0.15))])
    with pytest.raises(MeshError, match="of 1 cavities 0 are left; remedy: a smaller cell"):
        fill_surface(hollow.vertices, hollow.faces, cell=0.1, cells=CutCubes.CUT)
