# SPDX-License-Identifier: Apache-2.0
"""A ball that bounces."""

from __future__ import annotations

import pytest
import trimesh

from gdfe_ros import Simulation
from gdfe_ros.mesh.packing import pack_surface
from gdfe_ros.scene.loader import scene_from_text
from test.written import advance

SHOT = """
name: shot
mesh: {bar: {size: [0.05, 0.05, 0.05], cells: [3, 3, 3]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {}
obstacles: {wall: {box: {size: [0.01, 1, 1]}, at: [0.32, 0, 0], fixed: true}}
dynamics: {step: 0.005, velocity: [20, 0, 0]}
"""


@pytest.mark.parametrize(("thickness", "kind"), [(0.002, "box"), (0.05, "box"), (0.05, "mesh")])
def test_what_is_fast_does_not_pass_a_wall(thickness: float, kind: str) -> None:
    """A cube that hits a wall at 20 m/s, ten centimetres per step of 5 ms, bounces off, however thin the wall is.

    The speed after the impact depends on the moment of the impact within the step.
    """
    surface = trimesh.creation.box((thickness, 1.0, 1.0))
    forms = {
        "box": {"size": [thickness, 1.0, 1.0]},
        "mesh": {"embedded": pack_surface(surface.vertices, surface.faces), "cell": 0.01},
    }
    wall = {kind: forms[kind], "at": [0.32, 0.0, 0.0], "fixed": True}
    simulation = Simulation(scene_from_text(SHOT, overrides={"obstacles.wall": wall}))
    fronts = []
    for _ in range(10):
        result = advance(simulation)
        fronts.append(result.positions[:, 0].max())
    face = 0.32 - 0.5 * thickness
    assert max(fronts) == pytest.approx(face, abs=1e-4 * simulation.mesh.size)
    assert result.velocities[:, 0].mean() < -2.0
