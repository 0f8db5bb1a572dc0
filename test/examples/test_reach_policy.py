# SPDX-License-Identifier: Apache-2.0
"""The example policy in the environment of a robot."""

from __future__ import annotations

from pathlib import Path

import pytest

from gdfe_ros.examples.reach_policy import reach
from test.testing.test_environment import BAR


@pytest.mark.parametrize("seed", [0, 1])
def test_the_policy_reaches_the_goal(seed: int, tmp_path: Path) -> None:
    """An episode with two tendons ends within a twentieth of the initial distance to the goal."""
    path = tmp_path / "bar.yaml"
    path.write_text(BAR.replace("range: [0, 2]", "range: [0, 1]"), encoding="utf-8")
    start, end = reach(path, seed=seed, steps=25)
    assert end < 0.05 * start
