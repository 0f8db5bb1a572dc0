# SPDX-License-Identifier: Apache-2.0
"""Values of cells on the faces of the drawn surface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros.analysis.face_values import face_values
from gdfe_ros.mesh import HexMesh
from gdfe_ros.scene import load_scene

SCENE = """
name: rod
mesh: {voxels: {surface: rod.stl, cell: 0.005, cells: cut}}
skin: {file: rod.stl}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}}
"""


@pytest.fixture
def rod(tmp_path: Path) -> HexMesh:
    """Return the mesh of a rod with a skin."""
    surface = trimesh.creation.capsule(height=0.05, radius=0.01, count=[24, 24])
    surface.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    surface.export(tmp_path / "rod.stl")
    (tmp_path / "scene.yaml").write_text(SCENE)
    return load_scene(tmp_path / "scene.yaml").mesh


def test_faces_of_cells_have_the_values_of_their_cells() -> None:
    """Without a skin, each face has the value of its cell."""
    mesh = load_scene("bend5").mesh
    values = np.arange(mesh.n_cells, dtype=np.float64)
    np.testing.assert_array_equal(face_values(mesh, values), values[mesh.outside.cells])


def test_values_on_a_skin_change_smoothly(rod: HexMesh) -> None:
    """Across the edges of a skin's faces, values jump less than those of the cells, and a constant stays constant."""
    outside = rod.outside
    values = rod.vertices[rod.cells].mean(axis=1)[:, 0]
    on_faces = face_values(rod, values)
    assert values.min() <= on_faces.min()
    assert on_faces.max() <= values.max()
    edges: dict[tuple[int, int], list[int]] = {}
    for number, face in enumerate(outside.faces):
        for a, b in zip(face, np.roll(face, -1), strict=True):
            edges.setdefault((min(a, b), max(a, b)), []).append(number)
    pairs = np.array([pair for pair in edges.values() if len(pair) == 2])
    jumps = [np.abs(each[pairs[:, 0]] - each[pairs[:, 1]]).max() for each in (values[outside.cells], on_faces)]
    assert jumps[1] < 0.6 * jumps[0]
    np.testing.assert_allclose(face_values(rod, np.full(rod.n_cells, 3.0)), 3.0, rtol=1e-12)
