# SPDX-License-Identifier: Apache-2.0
"""An arm on the page: links are drawn at their poses, joints have sliders, and its bag replays."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gdfe_ros.scene import load_scene
from test.arms.conftest import SCENE, TWO_LINKS
from test.live.conftest import Live


def test_a_slider_moves_a_joint_and_its_links(tmp_path: Path) -> None:
    """Moving a joint's slider turns the drawn link, and the soft body follows."""
    (tmp_path / "two.urdf").write_text(TWO_LINKS)
    path = tmp_path / "held_block.yaml"
    path.write_text(SCENE.format(urdf="two.urdf") + "dynamics: {step: 0.01}\n")
    live = Live(load_scene(path))
    try:
        viewer = live.look()
        link = viewer.nodes["/arms/arm/0"]
        assert link["vertices"].size > 0
        rest = viewer.surface().copy()
        viewer.move("lift [rad]", 1.2)
        viewer.wait(lambda: abs(live.session.simulation.joint_positions["lift"] - 1.2) < 1e-9, "the joint")
        half = 0.5 * 1.2
        expected = [np.cos(half), 0.0, np.sin(half), 0.0]
        viewer.wait(lambda: np.allclose(viewer.nodes["/arms/arm/0"]["wxyz"], expected, atol=1e-3), "the link")
        assert np.abs(viewer.surface() - rest).max() > 0.1
    finally:
        live.close()
