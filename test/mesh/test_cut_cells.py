# SPDX-License-Identifier: Apache-2.0
"""Cubes cut by a surface have the moments of the material inside; slivers are merged into their neighbours."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gdfe_ros.actuators.load import corner_volumes
from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.filling import CORNERS, MODES, Filling
from gdfe_ros.mesh.mesh import HexMesh
from gdfe_ros.mesh.operators import shape_operators
from gdfe_ros.mesh.packing import pack_mesh, unpack_mesh
from gdfe_ros.mesh.voxels import LEAST_SHARE, CutCubes, cube_moments, fill_surface, gather_slivers
from gdfe_ros.solver.motion.inertia import mass_matrix

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


@pytest.mark.parametrize("fineness", [6, 12])
def test_shares_alone_are_too_stiff_by_what_the_theory_says(fineness: int) -> None:
    """Whole cells weighted by their filled fraction have a second moment too large by 2/3 (h / R)^2."""
    body, edge = trimesh.creation.cylinder(0.5, 1.0, sections=360), 1.0 / fineness
    mesh = fill_surface(body.vertices, body.faces, cell=edge, cells=CutCubes.CUT)
    second = mesh.filling.share @ (mesh.centroids[:, 0] ** 2 + edge**2 / 12.0) * edge**3
    excess = second / (np.pi / 4.0 * 0.5**4) - 1.0
    assert excess == pytest.approx(2.0 / 3.0 * (edge / 0.5) ** 2, rel=0.35)
    assert excess > 5.0 * abs(inertia(mesh, edge)[2][0] / (np.pi / 4.0 * 0.5**4) - 1.0)


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


def test_a_packed_mesh_keeps_its_filling() -> None:
    """A packed cut cylinder is unpacked to the same bits, and a mesh without a filling has none."""
    body = trimesh.creation.cylinder(0.5, 1.0)
    mesh = fill_surface(body.vertices, body.faces, cell=0.25, cells=CutCubes.CUT)
    again = unpack_mesh(pack_mesh(mesh))
    for name in ("share", "centre", "spread"):
        np.testing.assert_array_equal(getattr(again.filling, name), getattr(mesh.filling, name))
    assert unpack_mesh(pack_mesh(HexMesh(mesh.vertices, mesh.cells))).filling is None


def test_a_cavity_that_cut_cells_close_is_named() -> None:
    """A cavity smaller than a cell has no empty cube: it is refused, with a smaller cell as remedy."""
    hollow = trimesh.util.concatenate([trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.15, 0.15, 0.15))])
    with pytest.raises(MeshError, match="of 1 cavities 0 are left; remedy: a smaller cell"):
        fill_surface(hollow.vertices, hollow.faces, cell=0.1, cells=CutCubes.CUT)
