# SPDX-License-Identifier: Apache-2.0
"""Values of cells on the faces of the drawn surface."""

from __future__ import annotations

import numpy as np

from gdfe_ros.analysis.scenery import face_values
from gdfe_ros.scene import Scene, load_scene


def test_faces_of_cells_have_the_values_of_their_cells() -> None:
    """Without a skin, each face has the value of its cell."""
    mesh = load_scene("bend5").mesh
    values = np.arange(mesh.n_cells, dtype=np.float64)
    np.testing.assert_array_equal(face_values(mesh, values), values[mesh.outside.cells])


def test_values_on_a_skin_change_smoothly(rod: Scene) -> None:
    """Across the edges of a skin's faces, values jump less than those of the cells, and a constant stays constant."""
    mesh, outside = rod.mesh, rod.mesh.outside
    values = mesh.vertices[mesh.cells].mean(axis=1)[:, 0]
    on_faces = face_values(mesh, values)
    assert values.min() <= on_faces.min()
    assert on_faces.max() <= values.max()
    edges: dict[tuple[int, int], list[int]] = {}
    for number, face in enumerate(outside.faces):
        for a, b in zip(face, np.roll(face, -1), strict=True):
            edges.setdefault((min(a, b), max(a, b)), []).append(number)
    pairs = np.array([pair for pair in edges.values() if len(pair) == 2])
    jumps = [np.abs(each[pairs[:, 0]] - each[pairs[:, 1]]).max() for each in (values[outside.cells], on_faces)]
    assert jumps[1] < 0.6 * jumps[0]
    np.testing.assert_allclose(face_values(mesh, np.full(mesh.n_cells, 3.0)), 3.0, rtol=1e-12)
