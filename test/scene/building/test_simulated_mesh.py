# SPDX-License-Identifier: Apache-2.0
"""Every kind of mesh is loaded from a scene, and is part of the scene's source."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh

from gdfe_ros.errors import SceneError
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.cavities import find_cavities
from gdfe_ros.scene import load_scene, scene_from_text

SCENE = """\
name: any
mesh: {mesh}
materials: {{a: {{law: linear, young: 1.0e5, poisson: 0.4}}}}
regions: [{{material: a}}]
handles: {{base: {{where: {where}, fixed: true}}}}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a mesh file in millimetres and a hollow surface."""
    mesh = bar([200, 50, 50], [4, 2, 2])
    region = np.where(mesh.centroids[:, 0] < 100, 1, 2)
    raw = meshio.Mesh(mesh.vertices, [("hexahedron", mesh.cells)], cell_data={"region": [region]})
    raw.write(tmp_path / "bar.vtu")
    box, ball = trimesh.creation.box((0.1, 0.06, 0.04)), trimesh.creation.icosphere(radius=0.012)
    trimesh.util.concatenate([box, ball]).export(tmp_path / "hollow.stl")
    return tmp_path


@pytest.mark.parametrize(
    ("mesh", "where", "cavities"),
    [
        ("{file: bar.vtu, scale: 0.001}", "{set: region_1}", 0),
        ("{voxels: {surface: hollow.stl, cell: 0.004}}", "{face: x-}", 1),
        ("{tube: {inner: 0.01, outer: 0.02, length: 0.1, cells: [2, 8, 5], cap: 0.01}}", "{set: start}", 1),
        ("{ring: {radius: 0.05, section: [0.01, 0.02], cells: [2, 9, 2], angle: 90}}", "{set: end}", 0),
        ("{sphere: {inner: 0.01, outer: 0.02, cells: [4, 2]}}", "{set: outer}", 1),
        ("{finger: {size: [0.1, 0.02, 0.02], joints: 2, gap: 0.01, web: 0.005, cell: 0.005}}", "{set: base}", 0),
        (
            "{grid: {x: [0, 0.001, 0.002, 0.01, 0.011], y: [-0.01, -0.008, 0.008, 0.01], z: [0, 0.004, 0.005, 0.01], "
            "cut: [{box: {x: [0.001, 0.01], y: [-0.008, 0.008], z: [0.004, 0.005]}}]}}",
            "{face: x-}",
            1,
        ),
        (
            "{bar: {size: [0.1, 0.03, 0.03], cells: [10, 3, 3], cut: [{box: {x: [0.01, 0.09], "
            "y: [-0.005, 0.005], z: [-0.005, 0.005]}}]}}",
            "{face: x-}",
            1,
        ),
    ],
)
def test_each_kind_of_mesh_loads_and_rebuilds_without_files(folder: Path, mesh: str, where: str, cavities: int) -> None:
    """A mesh loaded from a file and from the source alone is the same, with its sets."""
    (folder / "scene.yaml").write_text(SCENE.format(mesh=mesh, where=where))
    scene = load_scene(folder / "scene.yaml")
    assert len(find_cavities(scene.mesh)) == cavities
    again = scene_from_text(scene.source)
    np.testing.assert_array_equal(again.mesh.vertices, scene.mesh.vertices)
    np.testing.assert_array_equal(again.mesh.cells, scene.mesh.cells)
    assert list(again.mesh.cell_sets) == list(scene.mesh.cell_sets)
    np.testing.assert_array_equal(again.handles[0].vertices, scene.handles[0].vertices)


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        ("{file: bar.vtu}", r"mesh.file = 'bar.vtu' \(line 2\): the body's diagonal is 212.*scale: 0.001"),
        ("{file: none.msh}", r"mesh.file = 'none.msh' \(line 2\): there is no such file; paths .* folder of the scene"),
        ("{file: bar.vtu, scale: -1}", r"mesh.scale = -1 .*0 < metres per unit"),
        ("{file: 3}", r"mesh.file = 3 .*the path of a file"),
        ("{voxels: {surface: hollow.stl}}", r"mesh.voxels.cell \(line 2\): is missing; needed is a number"),
        ("{voxels: {surface: hollow.stl, cell: 0.03}}", r"mesh.voxels.surface = 'hollow.stl'.*of 1 cavities 0"),
        ("{bar: {size: [1, 1, 1], cells: [1, 1, 1]}, merge: true}", r"merge belongs to `file`"),
        ("{ring: {radius: 0.1, section: [0.3, 0.1], cells: [1, 9, 1]}}", r"mesh.ring .*less than twice the radius"),
        ("{finger: {size: [0.1, 0.1, 0.1], joints: 1, gap: 0.01, web: 0.01, cell: 1e-5}}", r"cells; allowed: up to"),
        ("{bar: {size: [0.1, -0.1, 0.1], cells: [1, 0, 1]}}", r"mesh.bar.size = .*0 < length, width, height"),
        ("{bar: {size: [0.1, 0.1, 0.1], cells: [1, 1.5, 1]}}", r"mesh.bar.cells = .*whole numbers"),
        ("{tube: {inner: 0.0, outer: 1.0, length: 0.1, cells: [1, 6, 1]}}", r"mesh.tube.inner = 0.0 .*0 < inner"),
        ("{ring: {radius: 0.1, section: [0.02, 0.1], cells: [1, 9, 1], angle: 400}}", r"mesh.ring.angle = 400 .*360"),
        (
            "{finger: {size: [0.1, 0.1, 0.1], joints: 1, gap: 0.01, web: 0.01, cell: 0.01, taper: 0.0}}",
            r"mesh.finger.taper = 0.0 .*0 < size at the tip",
        ),
        ("{voxels: {surface: hollow.stl, cell: 0.0}}", r"mesh.voxels.cell = 0.0 .*0 < edge of the cubes"),
        ("{embedded: abc}", r"mesh.embedded = 'abc' .*damaged"),
        ("{tube: {}, ring: {}}", r"mesh.tube.inner .*is missing"),
    ],
)
def test_bad_meshes_are_defects_with_key_and_line(folder: Path, mesh: str, expected: str) -> None:
    """A bad mesh is reported with its key and line in the scene."""
    (folder / "scene.yaml").write_text(SCENE.format(mesh=mesh, where="{face: x-}"))
    with pytest.raises(SceneError) as caught:
        load_scene(folder / "scene.yaml")
    assert any(re.search(expected, defect) for defect in caught.value.defects), caught.value
    assert not any(defect.startswith("handles") for defect in caught.value.defects)


def test_text_cannot_name_files_by_relative_paths() -> None:
    """A text without a folder refuses relative paths, and requests a full path."""
    with pytest.raises(SceneError, match=r"a scene given as text has no folder"):
        scene_from_text(SCENE.format(mesh="{file: bar.vtu}", where="{face: x-}"))
