# SPDX-License-Identifier: Apache-2.0
"""Hexahedra that are long beside the section of a stretched bar: the bar twists, and the step says so."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose
from test.written import simulate

BAR = """
mesh: {{bar: {{size: [{length}, 0.01, 0.01], cells: {cells}}}}}
materials: {{m: {{law: neo_hookean, young: 1.0e5, poisson: 0.499}}}}
handles: {{left: {{where: {{face: x-}}, fixed: true}}, right: {{where: {{face: x+}}}}}}
"""


@pytest.mark.parametrize(
    ("cells", "stretch", "twists"),
    [
        ([8, 1, 1], 1.2, False),
        ([8, 1, 1], 1.4, True),
        ([4, 2, 2], 1.25, False),
        ([4, 2, 2], 1.4, True),
        ([8, 2, 2], 1.6, False),
        ([8, 2, 2], 2.0, True),
        ([16, 4, 4], 2.0, False),
    ],
)
def test_a_stretched_bar_of_long_cells_twists_and_says_so(cells: list[int], stretch: float, twists: bool) -> None:
    """A cell as long as the bar is wide twists from a stretch of 1.4 on, half as long from 2 on, a quarter not at 2."""
    length = 0.08 if cells[1] == 1 else 0.04
    simulation = simulate(BAR.format(length=length, cells=cells))
    outer = np.hypot(*simulation.positions[:, 1:].T) > 0.006
    y, z = simulation.positions[outer, 1:].T
    result = simulation.step(Command(handles={"right": Pose(((stretch - 1.0) * length, 0.0, 0.0))}))
    new_y, new_z = result.positions[outer, 1:].T
    turned = np.arctan2(y * new_z - z * new_y, y * new_y + z * new_z)
    assert result.converged
    assert (np.abs(turned).max() > np.radians(5.0)) == twists
    assert ("the cells are too coarse for this deformation" in result.message) == twists
