# SPDX-License-Identifier: Apache-2.0
"""Two cells on the same side of their common face overlap, and are a defect."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros.mesh import bar
from gdfe_ros.mesh.files.importer import examine_mesh
from gdfe_ros.mesh.quality import check_mesh
from gdfe_ros.mesh.tetmesh import divide, elevate
from gdfe_ros.scene import load_scene, scene_names

CASES = Path(__file__).parents[1] / "data" / "cases" / "overlap"
SAME = "cells that lie on the same side of the face that they share with another cell, and overlap it"
BAR = bar([0.05, 0.02, 0.02], [5, 2, 2])


@pytest.mark.parametrize("name", ["two_same_side.vtk", "hex_same_side.vtk"])
def test_the_cases_of_overlaps(name: str) -> None:
    """Both cells of the pair are named, with a place."""
    (defect,) = examine_mesh(CASES / name)[1]
    assert f"2 {SAME}: 0, 1, the first near" in defect


def test_the_sound_pair() -> None:
    """Two tetrahedra on opposite sides of their common face are sound."""
    assert examine_mesh(CASES / "two_opposite.vtk")[1] == []


@pytest.mark.parametrize("seed", range(10))
def test_a_folded_tetrahedron_is_found(seed: int) -> None:
    """One tetrahedron of a bar whose apex is mirrored at the face to a neighbour is found with this neighbour."""
    mesh = divide(BAR)
    rng = np.random.default_rng(seed)
    corners = mesh.cells[:, :4].copy()
    faces = np.sort(corners[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]], axis=2)
    while True:
        cell, apex = int(rng.integers(len(corners))), int(rng.integers(4))
        face = np.delete(corners[cell], apex)
        if sum((faces == np.sort(face)).all(axis=2).any(axis=1)) == 2:
            break
    a, b, c = mesh.vertices[face]
    normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
    top = mesh.vertices[corners[cell, apex]]
    points = np.vstack([mesh.vertices, top - 2.0 * (top - a) @ normal * normal])
    corners[cell, apex] = len(points) - 1
    swap = [k for k in range(4) if k != apex][:2]
    corners[cell, swap] = corners[cell, swap[::-1]]
    wrong = [text for text in check_mesh(elevate(points, corners)).defects if SAME in text]
    assert len(wrong) == 1
    assert str(cell) in wrong[0]


def test_the_volume_of_the_cells_is_that_of_their_boundary(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells whose boundary encloses another volume are a defect."""
    monkeypatch.setattr("gdfe_ros.mesh.quality.inside_volume", lambda *_: 1e-5)
    (defect,) = check_mesh(BAR).defects
    assert defect.startswith("the cells have a volume of 2e-05 m^3, but their boundary encloses 1e-05 m^3; remedy")


@pytest.mark.parametrize("name", scene_names())
def test_meshes_of_the_scenes_are_sound(name: str) -> None:
    """No shipped mesh has such cells, and the volumes agree."""
    mesh = load_scene(name).mesh
    assert not len(replace(mesh).boundary.folded)
