# SPDX-License-Identifier: Apache-2.0
"""The quality check measures known shapes and reports every defect with its ids."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, bar, check_mesh, require_sound
from gdfe_ros.mesh.quality import cell_volumes, coincident_pairs, scaled_jacobians


def cube(vertices: np.ndarray | None = None) -> HexMesh:
    """Return one unit cube, or one with other vertices."""
    mesh = bar([1, 1, 1], [1, 1, 1])
    return HexMesh(mesh.vertices if vertices is None else vertices, mesh.cells)


def test_scaled_jacobian_of_a_sheared_cube() -> None:
    """After a shear s every corner of a cube has the scaled Jacobian 1 / sqrt(1 + s^2)."""
    vertices = cube().vertices.copy()
    vertices[:, 0] += 0.75 * vertices[:, 2]
    assert scaled_jacobians(cube(vertices))[0] == pytest.approx(1 / np.hypot(1, 0.75))


def test_volume_of_a_frustum_is_exact() -> None:
    """The volume of a frustum is exact: h (a^2 + a b + b^2) / 3."""
    vertices = cube().vertices.copy()
    vertices[vertices[:, 2] > 0, :2] = 0.5 * (vertices[vertices[:, 2] > 0, :2])
    assert cell_volumes(cube(vertices))[0] == pytest.approx((1 + 0.5 + 0.25) / 3)


def test_volumes_of_a_distorted_mesh_add_up() -> None:
    """With inner vertices moved at random, the cell volumes still sum to the volume of the whole mesh."""
    mesh = bar([1, 1, 1], [3, 3, 3])
    vertices = mesh.vertices.copy()
    inner = np.setdiff1d(np.arange(mesh.n_vertices), mesh.surface())
    vertices[inner] += np.random.default_rng(3).uniform(-0.08, 0.08, (len(inner), 3))
    report = check_mesh(HexMesh(vertices, mesh.cells))
    assert report.volume == pytest.approx(1.0, rel=1e-13)
    assert 0 < report.min_scaled_jacobian < 0.99


def test_quality_does_not_depend_on_scale() -> None:
    """A micrometre bar and a kilometre bar have the same quality."""
    for scale in (1e-6, 1e3):
        report = check_mesh(bar([4 * scale, scale, scale], [4, 1, 1]))
        assert report.defects == []
        assert report.min_scaled_jacobian == pytest.approx(1.0)


def test_every_kind_of_defect_of_one_mesh_is_listed() -> None:
    """An inverted cell, a flat cell, an unused vertex and duplicate vertices are in one report."""
    mesh = bar([4, 1, 1], [4, 1, 1])
    cells = mesh.cells.copy()
    cells[1] = cells[1][[4, 5, 6, 7, 0, 1, 2, 3]]
    vertices = np.vstack([mesh.vertices, mesh.vertices[0], [9, 9, 9]])
    vertices[[4, 9, 14, 19], 0] = 3.0
    defects = check_mesh(HexMesh(vertices, cells)).defects
    text = "\n".join(defects)
    assert "1 cells that are inside out: 1, the first near (1.5, 0, 0);" in text
    assert "cells that are flat (no volume at a corner): 3, the first near (3, 0, 0);" in text
    assert "2 vertices that no cell uses: 20, 21;" in text
    assert "10 vertices at the same place as another" in text
    assert len(defects) == 4


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda v, c: c.__setitem__((0, 2), 99), "1 cells that name vertices outside 0 to 11: 0"),
        (lambda v, c: c.__setitem__((1, 2), c[1, 1]), "1 cells that name a vertex twice: 1"),
    ],
)
def test_broken_arrays_are_named(change: object, expected: str) -> None:
    """Ids out of range and repeated vertices are reported with their cells."""
    mesh = bar([2, 1, 1], [2, 1, 1])
    vertices, cells = mesh.vertices.copy(), mesh.cells.copy()
    change(vertices, cells)
    defects = check_mesh(HexMesh(vertices, cells)).defects
    assert any(expected in defect for defect in defects), defects


def test_three_cells_on_one_face_are_a_defect() -> None:
    """A third cell on a face of two others is reported."""
    mesh = bar([2, 1, 1], [2, 1, 1])
    extra = mesh.cells[1].copy()
    extra[[1, 2, 5, 6]] = [12, 13, 14, 15]
    vertices = np.vstack([mesh.vertices, mesh.vertices[mesh.cells[1][[1, 2, 5, 6]]] + [0.5, 0, 0]])
    defects = check_mesh(HexMesh(vertices, np.vstack([mesh.cells, extra]))).defects
    assert defects == ["3 cells that share a face with two or more others: 0, 1, 2; remedy: re-mesh there"]


def test_disconnected_parts_are_counted_and_no_defect() -> None:
    """Two separate bars are counted as two parts and are no defect."""
    one, two = bar([1, 1, 1], [1, 1, 1]), bar([1, 1, 1], [2, 1, 1])
    mesh = HexMesh(np.vstack([one.vertices, two.vertices + 5.0]), np.vstack([one.cells, two.cells + one.n_vertices]))
    report = check_mesh(mesh)
    assert report.defects == []
    assert report.parts == 2


def test_long_lists_of_ids_are_cut() -> None:
    """Of a long list of ids ten are printed, and the number of the others."""
    mesh = bar([1, 1, 1], [1, 1, 1])
    vertices = np.vstack([mesh.vertices, np.arange(90).reshape(30, 3) + 10.0])
    assert "30 vertices that no cell uses: 8, 9, 10, 11, 12, 13, 14, 15, 16, 17 and 20 more" in str(
        check_mesh(HexMesh(vertices, mesh.cells)).defects
    )


def test_coincident_pairs_agree_with_all_pairs() -> None:
    """The coincident pairs are those found by the distance matrix."""
    points = np.random.default_rng(4).integers(0, 6, (150, 3)) * 0.1
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    expected = {(i, j) for i, j in np.argwhere(distance <= 1e-9) if i < j}
    assert {tuple(pair) for pair in coincident_pairs(points, 1e-9)} == expected


def test_require_sound_raises_with_all_defects() -> None:
    """A mesh with defects raises MeshError with all of them and the mesh's name."""
    mesh = bar([1, 1, 1], [1, 1, 1])
    with pytest.raises(MeshError, match=r"my.msh: 1 defect"):
        require_sound(HexMesh(np.vstack([mesh.vertices, [7, 7, 7]]), mesh.cells), "my.msh")
    assert require_sound(mesh).volume == pytest.approx(1.0)
