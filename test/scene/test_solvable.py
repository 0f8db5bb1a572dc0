# SPDX-License-Identifier: Apache-2.0
"""Scenes whose materials differ too much."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.torture.bodies import BAR, make_scene
from gdfe_ros.errors import SceneError
from gdfe_ros.materials import Linear
from gdfe_ros.scene.solvable import LARGEST_CONTRAST
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Policy

HALVES = (BAR.centroids[:, 0] > 0.2).astype(np.int32)


@pytest.mark.parametrize("policy", list(Policy))
def test_too_large_a_contrast_is_refused(policy: Policy) -> None:
    """Materials with moduli 3e10 apart are refused by name, unless one is unused."""
    soft, hard = Linear(young=1.0, poisson=0.3), Linear(young=3.0 * LARGEST_CONTRAST, poisson=0.3)
    scene = make_scene(BAR, [soft, hard], policy=policy, cell_material=HALVES)
    with pytest.raises(SceneError, match=r"'m1' is 3e\+10 times as stiff at rest as 'm0'; allowed: up to 1e\+10"):
        Simulation(scene)
    Simulation(make_scene(BAR, [soft, hard], policy=policy, cell_material=np.ones_like(HALVES)))
