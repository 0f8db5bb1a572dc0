# SPDX-License-Identifier: Apache-2.0
"""The example policy in the environment of a robot."""

from __future__ import annotations

from pathlib import Path

import pytest

from gdfe_ros.examples.reach_policy import reach

BAR = """
name: bar
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [5, 1, 1]}}
materials: {rubber: {law: neo_hookean, young: 0.5e6, poisson: 0.45, density: 1000}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}}
actuators:
  lower: {cable: {points: [[0, 0, -0.008], [0.1, 0, -0.008]], range: [0, 1]}}
  left: {cable: {points: [[0, 0.008, 0], [0.1, 0.008, 0]], range: [0, 1]}}
probes: {tip: [0.1, 0, 0]}
"""


@pytest.mark.parametrize("seed", [0, 1])
def test_the_policy_reaches_the_goal(seed: int, tmp_path: Path) -> None:
    """An episode with two tendons ends within a twentieth of the initial distance to the goal."""
    path = tmp_path / "bar.yaml"
    path.write_text(BAR, encoding="utf-8")
    start, end = reach(path, seed=seed, steps=25)
    assert end < 0.05 * start
