# SPDX-License-Identifier: Apache-2.0
"""A reset of the arms alone: joints go back, and what they hold moves along in its shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError, OverlapError
from test.written import advance

_SCHEMES = ["", "dynamics: {step: 0.01}\n"]


@pytest.mark.parametrize("dynamics", _SCHEMES, ids=["statics", "motion"])
@pytest.mark.parametrize(
    "springs", ["", "compliance: {lift: {stiffness: 200, damping: 2}}, "], ids=["rigid", "yielding"]
)
def test_the_hand_moves_with_its_arm_and_keeps_its_shape(held_block: Path, dynamics: str, springs: str) -> None:
    """All distances within a sagging block stay, joints and wrist are at rest, time and loads go on."""
    text = held_block.read_text().replace("flange: tip, ", f"flange: tip, {springs}")
    held_block.write_text(text + dynamics)
    simulation = Simulation(load_scene(held_block))
    advance(simulation, Command(joints={"bend": 0.4}, loads={"weight": 3.0}), dt=0.02, count=30)
    before, time = simulation.positions.copy(), simulation.time
    account = simulation.stepper.find_imbalance(simulation.state) if dynamics else 0.0
    simulation.reset_arms()
    if dynamics:
        assert simulation.stepper.find_imbalance(simulation.state) == pytest.approx(account, abs=1e-12)
    np.testing.assert_allclose(pdist(simulation.positions), pdist(before), atol=1e-12)
    wrist = simulation.scene.handles[0]
    np.testing.assert_allclose(
        simulation.positions[wrist.vertices], simulation.mesh.vertices[wrist.vertices], atol=1e-12
    )
    assert simulation.joint_positions == pytest.approx({"lift": np.pi / 2, "bend": 0.0})
    assert (simulation.time, simulation.commands["weight"]) == (time, 3.0)
    assert simulation.step(dt=0.01).converged


def test_the_equilibrium_after_it_is_that_of_the_first_pose(held_block: Path) -> None:
    """In statics the step after the reset ends where a new simulation does."""
    used, new = (Simulation(load_scene(held_block)) for _ in range(2))
    used.step(Command(joints={"bend": 0.5}), dt=1.0)
    used.reset_arms()
    used.step(dt=0.1)
    new.step(dt=0.1)
    assert np.abs(used.positions - new.positions).max() < 2.0 * new.settings.tolerance * new.mesh.size


def test_a_hand_that_something_else_holds_stays(held_block: Path) -> None:
    """If another handle holds the same piece, the reset is refused and nothing changes; so it is without arms."""
    text = held_block.read_text().replace("{face: x-}}}", "{face: x-}}, post: {where: {face: x+}}}")
    held_block.write_text(text)
    simulation = Simulation(load_scene(held_block))
    simulation.step(Command(joints={"bend": 0.01}), dt=1.0)
    before = simulation.positions.copy()
    with pytest.raises(CommandError, match="post hold the same piece of the body as 'wrist'"):
        simulation.reset_arms()
    assert (simulation.positions == before).all()
    with pytest.raises(CommandError, match="has no arms"):
        Simulation(load_scene("bend5", overrides={"mesh.bar.cells": [5, 1, 1]})).reset_arms()


def test_a_box_in_the_way_is_named(held_block: Path) -> None:
    """If a rigid body lies where the hand would go, the reset is refused and nothing changes."""
    body = "bodies: {part: {box: {size: [0.02, 0.02, 0.02]}, mass: 0.05, at: [0.02, 0.3, 0]}}\n"
    held_block.write_text(held_block.read_text() + _SCHEMES[1] + body)
    simulation = Simulation(load_scene(held_block, overrides={"loads.weight.gravity": [0, 0, -1e-3]}))
    advance(simulation, Command(joints={"bend": 1.0}), dt=0.02, count=40)
    simulation.step(Command(bodies={"part": Pose((0.0, -0.3, 0.0))}), dt=0.01)
    before = simulation.positions.copy()
    with pytest.raises(OverlapError, match="part"):
        simulation.reset_arms()
    assert (simulation.positions == before).all()
