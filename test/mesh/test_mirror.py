# SPDX-License-Identifier: Apache-2.0
"""Reflection of meshes."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros import Simulation
from gdfe_ros.mesh import bar, check_mesh
from gdfe_ros.mesh.assembly import mirror
from gdfe_ros.mesh.generators import finger
from gdfe_ros.mesh.quality import cell_volumes
from gdfe_ros.mesh.tetmesh import divide
from gdfe_ros.scene import load_scene

HAND = """
name: hand
meshes:
  right: {voxels: {surface: part.stl, cell: 0.006, cells: cut}, skin: {file: part.stl}, at: [0, 0.05, 0]}
  left: {voxels: {surface: part.stl, cell: 0.006, cells: cut}, skin: {file: part.stl}, at: [0, -0.05, 0], mirror: y}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4}}
regions: [{material: soft}]
handles: {flange: {where: {any: [{mesh: left, face: x-}, {mesh: right, face: x-}]}}}
loads:
  right: {surface: {force: [0, 0.02, 0.01], where: {mesh: right, face: x+}}}
  left: {surface: {force: [0, -0.02, 0.01], where: {mesh: left, face: x+}}}
program:
  duration: 1.0
  loads: {right: [{time: 0, value: 0}, {time: 1, value: 1}], left: [{time: 0, value: 0}, {time: 1, value: 1}]}
"""


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_reflected_mesh_is_sound(axis: int) -> None:
    """Reflected cells keep their volumes, faces look outward, and two reflections give the first mesh."""
    mesh = finger((0.1, 0.02, 0.02), joints=2, gap=0.004, web=0.005, cell=0.005, taper=0.7)
    other = mirror(mesh, axis)
    assert not check_mesh(other).defects
    np.testing.assert_allclose(cell_volumes(other), cell_volumes(mesh), rtol=1e-12)
    corners = other.vertices[other.surface()]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
    outwards = np.einsum("qi,qi->q", normals, corners[:, 0])
    assert outwards.sum() > 0.0
    again = mirror(other, axis)
    assert np.array_equal(again.vertices, mesh.vertices)
    assert np.array_equal(again.cells, mesh.cells)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_reflected_tetrahedra_are_sound(axis: int) -> None:
    """Reflected tetrahedra keep edge nodes on their edges and no cell is inverted; two reflections give the first."""
    mesh = divide(bar((0.1, 0.02, 0.03), (4, 2, 2)))
    other = mirror(mesh, axis)
    assert not check_mesh(other).defects
    ends = other.vertices[other.cells[:, [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]]]
    np.testing.assert_allclose(other.vertices[other.cells[:, 4:]], ends.mean(axis=2), atol=1e-15)
    assert np.array_equal(mirror(other, axis).cells, mesh.cells)


@pytest.fixture
def hand(tmp_path: Path) -> Path:
    """Return the file of a scene with a part and its mirror image on one flange."""
    part = trimesh.creation.box((0.08, 0.02, 0.02))
    part.vertices[part.vertices[:, 0] > 0, 1] += 0.006
    part.export(tmp_path / "part.stl")
    (tmp_path / "hand.yaml").write_text(HAND)
    return tmp_path / "hand.yaml"


def test_mirrored_loads_give_mirrored_shapes(hand: Path) -> None:
    """A part and its mirror image, under mirrored loads, deform into mirror images, also with skins and cut cells."""
    simulation = Simulation(load_scene(hand))
    result = list(simulation.play())[-1]
    assert result.converged
    right, left = (simulation.scene.mesh.parts[name] for name in ("right", "left"))
    count = right.mesh.n_vertices
    first, second = (result.positions[part.first_vertex : part.first_vertex + count] for part in (right, left))
    np.testing.assert_allclose(first, second * [1.0, -1.0, 1.0], atol=2e-5)
    assert np.abs(first - right.place().vertices).max() > 1e-3
    skin = right.mesh.skin.at(right.mesh.vertices), left.mesh.skin.at(left.mesh.vertices)
    np.testing.assert_allclose(skin[0], skin[1] * [1.0, -1.0, 1.0], atol=1e-12)
