# SPDX-License-Identifier: Apache-2.0
"""Fuzzing of bodies that join a scene: any text is refused, or joins, moves and leaves the scene as it was."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gdfe_ros.errors import ArmError, OverlapError, SceneError
from gdfe_ros.node.driving.remodelling import take_over
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.entity import read_entity, with_body, without_bodies
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation
from test.torture.examples import ODD, entries_of, examples, with_value

SCENE = """\
name: small
mesh: {bar: {size: [0.1, 0.1, 0.03], cells: [2, 2, 1]}}
materials:
  soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1.0e3}
  body_hard: {law: linear, young: 1.0e6, poisson: 0.3, density: 1.0e3}
regions: [{material: soft}, {material: body_hard, where: {box: {x: [0.05, 0.1]}}}]
handles: {base: {where: {face: z-}, fixed: true}}
dynamics: {step: 0.005}
"""
GEL = "{law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1.0e3}"
BODIES = [
    yaml.safe_load(text)
    for text in (
        f"{{bar: {{size: [0.03, 0.03, 0.03], cells: [2, 2, 2]}}, material: {GEL}}}",
        f"{{name: ball, mesh: {{sphere: {{inner: 0.004, outer: 0.015, cells: [2, 1]}}}}, materials: {{skin: {GEL}, "
        f"core: {GEL}}}, regions: [{{material: skin}}, {{material: core, where: {{box: {{x: [0, 1]}}}}}}]}}",
        "{box: {size: [0.03, 0.03, 0.03]}, mass: 0.02, friction: 0.5}",
        "{sphere: {radius: 0.02}, density: 1000}",
    )
]
pytestmark = pytest.mark.usefixtures("limited")
CHOICES = [(number, place) for number, body in enumerate(BODIES) for place in entries_of(body)]


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Return the scene that bodies join."""
    return scene_from_text(SCENE)


@given(st.sampled_from(CHOICES), ODD)
@example((0, ("bar", "size")), [1e-5, 1e-5, 1e-5])
@example((0, ("bar",)), {"embedded": "x"})
@example((0, ("material", "density")), 1e-303)
@example((1, ("materials",)), False)
@example((1, ("regions",)), 5)
@example((1, ("regions", 1, "material")), "body_hard")
@example((2, ("mass",)), 1e-300)
@example((3, ("radius",)), 1e-170)
@examples(60)
def test_a_body_with_one_odd_value(scene: Scene, choice: tuple[int, tuple[Any, ...]], value: Any) -> None:
    """It is refused with a reason, or its first step converges to finite places, and it leaves nothing behind."""
    number, place = choice
    joined, reason = None, ""
    try:
        body = read_entity(yaml.safe_dump(with_value(BODIES[number], place, value)))
        joined = with_body(scene, "body", body, origin=np.array([0.4, 0.0, 0.2]), turn=Rotation.identity())
        new = Simulation(joined)
        take_over(Simulation(scene), new)
    except (ArmError, OverlapError, SceneError) as error:
        joined, reason = None, str(error)
    if joined is None:
        assert 0 < len(reason) < 20000
        return
    result = new.step(dt=0.005)
    assert np.isfinite(result.positions).all()
    assert result.converged or result.message
    assert list(without_bodies(joined, ["body"]).materials) == list(scene.materials)
