# SPDX-License-Identifier: Apache-2.0
"""Self-contact in a node: published, measured by sensors, recorded and replayed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros.constraints import Pose
from gdfe_ros.simulation import Command
from gdfe_ros.testing import Simulator

PAIR = """
name: pair
mesh: {bar: {size: [0.11, 0.04, 0.04], cells: [11, 3, 3], cut: [{box: {x: [0.05, 0.06]}}]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4}}
regions: [{material: soft}]
handles: {left: {where: {face: x-}, fixed: true}, right: {where: {face: x+}}}
self_contact: {friction: 0.3}
sensors: {pad: {where: {box: {x: [0.0499, 0.0501]}}}}
"""


def test_who_touches_whom_is_told_and_replayed(tmp_path: Path, replays: Callable) -> None:
    """With a block pressed on another, points name both blocks, the sensor has the force, and the bag replays."""
    path, bag = tmp_path / "pair.yaml", tmp_path / "bag"
    path.write_text(PAIR)
    with Simulator(path, bag=bag) as simulator:
        assert not len(simulator.state.contacts)
        for way in (-0.0095, -0.013):
            state = simulator.step(Command(handles={"right": Pose((way, 0.0, 0.002))}))
    points, rest = state.contacts, simulator.scene.mesh.vertices
    assert len(points) == 32
    assert set(points["contact"]) == {0}
    assert ((rest[points["vertex"], 0] < 0.055) != (rest[points["other"], 0] < 0.055)).all()
    forces = np.stack([points[f"f{axis}"] + points[f"t{axis}"] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-5 * np.abs(forces).sum())
    felt = forces[rest[points["vertex"], 0] < 0.055].sum(axis=0)
    assert felt[0] < -1.0
    assert state.sensors["pad"][:3] == pytest.approx(felt, rel=1e-4, abs=1e-4)
    assert {("contacts", "other"), ("sensors/pad/wrench", "wrench.force.x")} <= replays(bag)
