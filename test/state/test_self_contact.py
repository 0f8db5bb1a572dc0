# SPDX-License-Identifier: Apache-2.0
"""Self-contact together with other state: checkpoints, resets, cut steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.constraints.obstacle import NAME
from gdfe_ros.scene.loader import scene_from_text

PAIR = """
name: pair
mesh: {bar: {size: [0.11, 0.04, 0.04], cells: [11, 3, 3], cut: [{box: {x: [0.05, 0.06]}}]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {left: {where: {face: x-}, fixed: true}, right: {where: {face: x+}}}
self_contact: {friction: 0.3}
"""
MOVES = [(-0.009, 0.0), (-0.012, 0.0), (-0.012, 0.004), (-0.013, 0.009), (-0.008, 0.009), (-0.012, 0.009)]
"""Positions of the right block along x and z [m]: it presses, sticks, slips, separates and comes back."""


def make(**overrides: Any) -> Simulation:
    """Return two blocks that face each other; keyword arguments override scene keys."""
    return Simulation(scene_from_text(PAIR, overrides=overrides))


def pressed(simulation: Simulation, moves: list[tuple[float, float]] = MOVES) -> list[np.ndarray]:
    """Move the right block, with dynamics four steps for each position; return the positions after each step."""
    again = 4 if simulation.scene.dynamics else 1
    places = [Pose((x, 0.0, z)) for x, z in moves for _ in range(again)]
    return [simulation.step(Command(handles={"right": place})).positions for place in places]


@pytest.mark.parametrize("motion", [{}, {"dynamics": {"scheme": "bdf2", "step": 0.005}}], ids=["still", "moves"])
def test_a_checkpoint_goes_on_to_the_bit(motion: dict[str, Any]) -> None:
    """Blocks saved while they rub, and loaded elsewhere, continue with the same bits; so does a run after a reset."""
    first, second = make(**motion), make(**motion)
    before = pressed(first, MOVES[:3])
    assert first.result.contacts[NAME].presses.max() > 0.01
    load_state(second, save_state(first))
    after = pressed(first, MOVES[3:])
    for one, two in zip(after, pressed(second, MOVES[3:]), strict=True):
        np.testing.assert_array_equal(one, two)
    first.reset()
    for one, two in zip(pressed(first), before + after, strict=True):
        np.testing.assert_array_equal(one, two)


def test_steps_that_are_cut_go_on_to_the_same_bits() -> None:
    """Two runs cut at the same place have the same bits, and both converge."""
    first, second = make(), make()
    for simulation in (first, second):
        goal = Command(handles={"right": Pose((-0.013, 0.0, 0.004))})
        assert not simulation.step(goal, cut_after=2).converged
        for _ in range(20):
            result = simulation.step(goal)
            if result.converged:
                break
        assert result.converged
    np.testing.assert_array_equal(first.positions, second.positions)
