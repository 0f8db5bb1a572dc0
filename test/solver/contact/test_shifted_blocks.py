# SPDX-License-Identifier: Apache-2.0
"""Stacked blocks whose rims do not match: rims of flat faces cross near their corners."""

from __future__ import annotations

import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.constraints.obstacle import NAME
from gdfe_ros.scene import scene_from_text
from test.written import advance

BLOCKS = """
name: blocks
meshes:
  low: {{bar: {{size: [0.05, 0.05, 0.03], cells: [5, 5, 3]}}, at: [-0.025, 0, -0.0151]}}
  high: {{bar: {{size: [0.05, 0.05, 0.03], cells: {cells}}}, at: [{at}, 0, 0.0151]}}
materials:
  hard: {{law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}
  soft: {{law: neo_hookean, young: {young}, poisson: 0.45, density: 1000}}
regions: [{{material: hard}}, {{material: soft, where: {{mesh: high}}}}]
handles: {{low: {{where: {{mesh: low, face: z-}}, fixed: true}}, high: {{where: {{mesh: high, face: z+}}}}}}
self_contact: {{friction: {friction}}}
"""


@pytest.mark.parametrize(
    ("shift", "cells", "young", "friction", "steps"),
    [
        (0.001, [5, 5, 3], 1e5, 0.0, 5),
        (0.01, [4, 4, 3], 1e5, 0.0, 4),
        (0.001, [5, 5, 3], 2e4, 0.3, 8),
        (0.01, [5, 5, 3], 5e4, 0.3, 8),
        (0.01, [4, 4, 3], 5e4, 0.3, 8),
    ],
)
def test_blocks_that_are_shifted_are_pressed(
    shift: float, cells: list[int], young: float, friction: float, steps: int
) -> None:
    """Each step converges, and the forces on both sides cancel. Earlier, about every second of these steps failed."""
    simulation = Simulation(
        scene_from_text(BLOCKS.format(at=shift - 0.025, cells=cells, young=young, friction=friction))
    )
    for k in range(1, steps + 1):
        result = advance(simulation, Command(handles={"high": Pose((0.0, 0.0, -0.001 * k))}))
    assert result.reactions["low"][2] == pytest.approx(-result.reactions["high"][2], rel=1e-3)
    touch = result.contacts[NAME]
    assert abs(touch.forces.sum(axis=0)).max() < 1e-9 * touch.presses.sum()
