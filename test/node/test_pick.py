# SPDX-License-Identifier: Apache-2.0
"""A controller lets a node's soft hand on a stock arm pick a rigid box, over topics and by the action."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.examples.pick import find_published_errors, pick


def test_a_node_picks_a_box(tmp_path: Path, interfaces: Callable[[str], None], replays: Callable) -> None:
    """The box is lifted, carried with m (a - g) to 1 % in the mean of eight steps, and the bag replays to the bit."""
    interfaces("control_msgs")
    states = pick("pick_ur5e", bag=tmp_path / "bag", duration=2.9)
    errors = find_published_errors(BagRun(tmp_path / "bag").scene, states, soft=False)
    assert len(errors) > 20
    assert errors.max() < 0.01
    assert states[-1].poses["box"].translation[2] > 0.03
    _, _, effort = states[-1].joints["shoulder_lift_joint"]
    assert abs(effort) > 20.0
    replays(tmp_path / "bag")
