# SPDX-License-Identifier: Apache-2.0
"""Actuators, loads and probes of a scene file are built, and every defect is named with its remedy."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.actuators import Cable, Chamber, Growth, Mode
from gdfe_ros.errors import SceneError
from gdfe_ros.scene import scene_from_text

HOLLOW = """\
name: hollow
mesh:
  bar:
    size: [0.1, 0.02, 0.02]
    cells: [10, 4, 4]
    cut:
      - {box: {x: [0.01, 0.04], y: [-0.005, 0.005], z: [-0.005, 0.005]}}
      - {box: {x: [0.05, 0.09], y: [-0.005, 0.005], z: [-0.005, 0.005]}}
materials:
  m: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000.0}
regions:
  - {material: m}
handles:
  base: {where: {face: x-}, fixed: true}
"""
ACTUATORS = """\
actuators:
  tendon:
    cable:
      points: [[0, 0, 0.01], [0.05, 0, 0.01], [0.1, 0, 0.01]]
      command: length
      range: [0.08, 0.1]
      rate: 0.01
  large: {chamber: {cavity: 0, command: volume}}
  small: {chamber: {near: [0.02, 0, 0]}}
  heat: {growth: {stretch: [0.9, 1, 1], where: {face: x+}}}
loads:
  weight: {gravity: [0, 0, -9.81]}
  tip: {point: {at: [0.1, 0, 0], force: [0, 0, -0.1]}}
  wind: {surface: {where: {face: z+}, force: [0, 1.0, 0]}}
probes:
  tip: [0.1, 0, 0]
program:
  duration: 2.0
  actuators:
    tendon: [{time: 1.0, value: 0.09}]
    large: [{time: 1.0, value: 3.0e-6}, {time: 2.0, value: 4.0e-6}]
  loads:
    weight: [{time: 2.0, value: 1.0}]
"""


def test_every_kind_is_built() -> None:
    """Modes, ranges, chambers and loads are those of the file."""
    scene = scene_from_text(HOLLOW + ACTUATORS)
    tendon, large, small, heat = scene.actuators
    assert isinstance(tendon, Cable)
    assert (tendon.mode, tendon.low, tendon.high, tendon.rate) == (Mode.LENGTH, 0.08, 0.1, 0.01)
    assert isinstance(large, Chamber)
    assert isinstance(small, Chamber)
    centers = [scene.mesh.vertices[np.unique(item.quads)].mean(axis=0)[0] for item in (large, small)]
    np.testing.assert_allclose(centers, [0.07, 0.025])
    assert isinstance(heat, Growth)
    assert len(heat.cells) == 16
    np.testing.assert_allclose(heat.stretch, np.diag([0.9, 1, 1]))
    weight, tip, wind = (load.forces(scene.mesh.vertices, scene.mesh.cells).sum(axis=0) for load in scene.loads)
    np.testing.assert_allclose(weight[2], -9.81 * 1000 * (4e-5 - 7e-6))
    np.testing.assert_allclose(tip, [0, 0, -0.1])
    np.testing.assert_allclose(wind, [0, 1.0, 0], atol=1e-12)
    np.testing.assert_allclose(scene.probes["tip"].at(scene.mesh.vertices), [[0.1, 0, 0]])


def test_program_starts_from_what_does_nothing() -> None:
    """A program starts from the undeformed length and volume and from no load, and keeps its last command."""
    program = scene_from_text(HOLLOW + ACTUATORS).program
    assert program.times == (0.0, 1.0, 2.0)
    assert program.actuator_values(0.0) == pytest.approx({"tendon": 0.1, "large": 4e-6})
    assert program.actuator_values(0.5)["tendon"] == pytest.approx(0.095)
    assert program.actuator_values(9.0) == pytest.approx({"tendon": 0.09, "large": 4e-6})
    assert program.load_factors(1.0) == {"weight": 0.5}


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("[0.05, 0, 0.01]", "[0.05, 0, 0.03]", r"tendon\.cable\.points.*point 1 at \(0.05, 0, 0.03\) m lies outside"),
        ("[0.05, 0, 0.01]", "[0.025, 0, 0.0]", r"point 1 at .* lies outside of the body; the body is near"),
        ("cavity: 0", "cavity: 5", r"large\.chamber\.cavity = 5 .*there are: 0: 4e-06 m\^3 near \[0.07"),
        ("cavity: 0, ", "", r"large\.chamber .*the body has 2 cavities .*remedy: name one by cavity or near"),
        ("{near: [0.02, 0, 0]}", "{where: {box: {x: [0.01, 0.04], z: [0.004, 0.006]}}}", r"faces leak at \d+ edges"),
        ("{near: [0.02, 0, 0]}", "{where: {face: z+}}", r"small\.chamber\.where.*faces leak at"),
        ("density: 1000.0", "omega: 0.5", r"gravity needs a density: give `density` \[kg/m\^3\] to m"),
        ("value: 0.09}", "value: 0.2}", r"tendon\.0\.value = 0.2 .*allowed by the actuator's range: 0.08 to 0.1"),
        ("    large: [", "    huge: [", r"there is no such actuator.*allowed: tendon, large, small, heat"),
        ("command: length", "command: lenght", r"command = 'lenght' .*did you mean 'length'"),
        ("[0.9, 1, 1]", "[-0.9, 1, 1]", r"stretch.*0.05 <= stretch along x, y, z at command 1 <= 20"),
        ("range: [0.08, 0.1]", "range: [-1, 0.1]", r"allowed for length \[m\]: 0 to inf"),
        ("  wind: {surface", "  small: {surface", r"loads\.small .*an actuator has this name"),
        ("[0.1, 0, 0]\nprogram", "[0.2, 0, 0]\nprogram", r"probes\.tip .*lies outside of the body"),
        ("force: [0, 1.0, 0]}}", "force: [0, 1, 0], traction: [0, 1, 0]}}", r"give either traction \[Pa\] or force"),
    ],
)
def test_defects_are_named(old: str, new: str, expected: str) -> None:
    """An entry with one defect is refused with its key, its value and the remedy."""
    assert old in HOLLOW + ACTUATORS
    with pytest.raises(SceneError, match=expected):
        scene_from_text((HOLLOW + ACTUATORS).replace(old, new, 1))
