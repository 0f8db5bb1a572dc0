# SPDX-License-Identifier: Apache-2.0
"""Obstacles in scene files."""

from __future__ import annotations

import re
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import trimesh

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import SceneError
from gdfe_ros.scene import load_scene, scene_from_text
from test.written import advance

SCENE = """\
name: any
mesh: {{bar: {{size: [0.1, 0.05, 0.05], cells: [8, 4, 4]}}}}
materials: {{a: {{law: neo_hookean, young: 1.0e5, poisson: 0.4}}}}
regions: [{{material: a}}]
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
obstacles:
  part: {{mesh: {mesh}, at: [0.08, 0, -0.05]}}
"""
BALL = trimesh.creation.icosphere(subdivisions=4, radius=0.02)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a ball in millimetres."""
    BALL.copy().apply_scale(1000.0).export(tmp_path / "ball.stl")
    BALL.copy().apply_scale(1000.0).export(tmp_path / "ball.obj")
    return tmp_path


def test_the_length_of_a_planes_normal_does_not_matter() -> None:
    """A plane has the same orientation with a normal of any length."""
    text = SCENE.replace("mesh: {mesh}", "plane: [{plane}]")
    found = [scene_from_text(text.format(plane=f"{0.3 * k}, 0, {k}")).handles[-1].turn for k in (1.0, 1e-300, 1e6)]
    assert found[1] == pytest.approx(found[0])
    assert found[2] == pytest.approx(found[0])


@pytest.mark.parametrize("file", ["ball.stl", "ball.obj"])
def test_a_scene_carries_its_obstacles_surface(folder: Path, file: str) -> None:
    """An obstacle's surface from a file and from the source alone gives a pressed body with the same bits."""
    (folder / "scene.yaml").write_text(SCENE.format(mesh=f"{{file: {file}, scale: 0.001}}"))
    scene = load_scene(folder / "scene.yaml")
    assert file not in scene.source
    ends = []
    for each in (scene, scene_from_text(scene.source)):
        result = advance(Simulation(each), Command(handles={"part": Pose((0.0, 0.0, 0.01))}))
        assert result.reactions["part"][2] > 0.01
        ends.append(result.positions)
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        ("{file: none.stl, scale: 0.001}", r"obstacles.part.mesh.file = 'none.stl' \(line 7\): there is no such file"),
        ("{file: ball.stl}", r"obstacles.part.mesh.file = 'ball.stl' .*diagonal is 69.* `scale: 0.001`"),
        ("{file: ball.stl, scale: 1}", r"obstacles.part.mesh .*cell, 0.625 m, is too coarse .*check `scale`"),
        ("{file: ball.stl, scale: 10}", r"obstacles.part.mesh .*times as much as the body .*remedy: check `scale`"),
        ("{file: ball.stl, scale: -1}", r"obstacles.part.mesh.scale = -1 .*0 < metres per unit"),
        ("{file: ball.stl, scale: 0.001, cell: 0}", r"obstacles.part.mesh.cell = 0 .*0 < spacing of the grid"),
        ("{embedded: abc}", r"obstacles.part.mesh.embedded = 'abc' .*damaged"),
        ("{embedded: abc, scale: 2}", r"obstacles.part.mesh .*scale belongs to `file`"),
        ("{}", r"obstacles.part.mesh .*give exactly one of file, embedded"),
    ],
)
def test_bad_surfaces_are_defects_with_key_and_line(folder: Path, mesh: str, expected: str) -> None:
    """A bad surface of an obstacle is reported with its key, line, reason and remedy."""
    (folder / "scene.yaml").write_text(SCENE.format(mesh=mesh))
    with pytest.raises(SceneError) as caught:
        load_scene(folder / "scene.yaml")
    assert any(re.search(expected, defect) for defect in caught.value.defects), caught.value


def test_a_missing_library_is_named(folder: Path) -> None:
    """Without trimesh, a surface file is refused with what to install."""
    (folder / "scene.yaml").write_text(SCENE.format(mesh="{file: ball.stl, scale: 0.001}"))
    with (
        patch.dict("sys.modules", {"trimesh": None}),
        pytest.raises(SceneError, match=r"pip install 'gdfe_ros\[mesh\]'"),
    ):
        load_scene(folder / "scene.yaml")
