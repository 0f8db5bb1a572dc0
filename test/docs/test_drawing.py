# SPDX-License-Identifier: Apache-2.0
"""Parametric drawings of docs/scripts: volumes in closed form, and the meshes of shipped scenes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from docs.scripts.cad_arm import NAME, Arm
from docs.scripts.cad_finger import Finger
from docs.scripts.cad_part import Part
from docs.scripts.cad_pneunet import FINGER
from docs.scripts.cad_pneunet import NAME as PNEUNET
from docs.scripts.drawing import Drawing, write_step
from gdfe_ros.mesh import check_mesh
from gdfe_ros.mesh.cavities import find_cavities
from gdfe_ros.mesh.meshing.tetrahedralise import step_facts
from gdfe_ros.scene import load_scene


@pytest.mark.parametrize("drawing", [Arm(), Arm(partition=5.0), Finger(), FINGER, Part()])
def test_a_drawing_has_the_volume_of_its_dimensions(drawing: Drawing, tmp_path: Path) -> None:
    """The volume of the STEP file is that of the closed form, to the digits that are shown."""
    write_step(drawing, tmp_path / "drawn.step")
    shown = dict(step_facts(tmp_path / "drawn.step"))["volume"].split()[0]
    assert float(shown) == pytest.approx(1e-9 * drawing.volume, rel=1e-5)


@pytest.mark.parametrize(("name", "drawing", "chambers"), [(NAME, Arm(), 4), (PNEUNET, FINGER, 1)])
def test_a_shipped_mesh_is_that_of_its_drawing(name: str, drawing: Drawing, chambers: int) -> None:
    """The mesh of a shipped scene is sound, and has the volume and the chambers of the drawing."""
    mesh = load_scene(name).mesh
    report = check_mesh(mesh)
    assert report.defects == []
    assert report.volume == pytest.approx(1e-9 * drawing.volume, rel=1e-4)
    assert len(find_cavities(mesh)) == chambers


def test_chambers_of_the_arm_are_where_their_names_say() -> None:
    """Each of the four chambers has the drawn volume, and each name has a chamber of its own."""
    scene, arm = load_scene(NAME), Arm()
    expected = 1e-9 * arm.section * (arm.length - arm.solid)
    assert [cavity.volume for cavity in find_cavities(scene.mesh)] == pytest.approx([expected] * 4, rel=1e-4)
    middles = [scene.mesh.vertices[chamber.vertices, :2].mean(axis=0) for chamber in scene.actuators]
    np.testing.assert_array_equal(np.sign(middles), [[1, 1], [-1, 1], [-1, -1], [1, -1]])
