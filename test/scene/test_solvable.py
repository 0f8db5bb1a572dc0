# SPDX-License-Identifier: Apache-2.0
"""Scenes whose materials differ too much."""

from __future__ import annotations

import pytest

from gdfe_ros.errors import SceneError
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.solvable import LARGEST_CONTRAST
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Policy


@pytest.mark.parametrize("policy", list(Policy))
def test_too_large_a_contrast_is_refused(policy: Policy, sound: str) -> None:
    """Materials with moduli 3e10 apart are refused by name, unless one is unused."""
    hard = {"law": "linear", "young": 3.0 * LARGEST_CONTRAST, "poisson": 0.3}
    given = {"materials.soft.young": 1.0, "materials.hard": hard, "solver.policy": policy.value}
    with pytest.raises(SceneError, match=r"'hard' is 3e\+10 times as stiff at rest as 'soft'; allowed: up to 1e\+10"):
        Simulation(scene_from_text(sound, overrides=given))
    Simulation(scene_from_text(sound, overrides={**given, "regions": [{"material": "hard"}]}))
