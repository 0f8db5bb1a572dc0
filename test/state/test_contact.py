# SPDX-License-Identifier: Apache-2.0
"""Contact together with other state: cut steps, and places far from the origin."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from test.written import simulate

BAR = """
mesh: {bar: {size: [0.2, 0.04, 0.04], cells: [20, 3, 3]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}}, tip: {where: {face: x+}}}
obstacles: {pin: {sphere: {radius: 0.015}, at: [0.13, 0.0, -0.04], friction: 0.4}}
"""
MOVES = [(0.0, 0.008), (0.004, 0.012)]
"""Positions of the pin along x and z [m]: it presses and rubs."""


def press(simulation: Simulation) -> None:
    """Move the pin."""
    for x, z in MOVES:
        simulation.step(Command(handles={"pin": Pose((x, 0.0, z))}))


def test_steps_that_are_cut_arrive_at_the_same_contact() -> None:
    """Steps that are each cut after a few iterations reach the same contact equilibrium and converge."""
    whole, cut = simulate(BAR, obstacles__pin__friction=0.0), simulate(BAR, obstacles__pin__friction=0.0)
    wanted = Command(handles={"pin": Pose((0.0, 0.0, 0.01))})
    target = whole.step(wanted)
    for _ in range(300):
        result = cut.step(wanted, cut_after=3)
        if result.converged:
            break
    assert result.converged
    assert np.abs(result.positions - target.positions).max() < 5e-4 * whole.mesh.size
    assert result.reactions["pin"][2] == pytest.approx(target.reactions["pin"][2], rel=0.03)


def test_far_from_the_origin_it_is_the_same_contact() -> None:
    """Contact forces a kilometre from the origin equal those at the origin."""
    near = simulate(BAR)
    press(near)
    scene = near.scene
    away = np.array([1000.0, -500.0, 200.0])
    mesh = dataclasses.replace(scene.mesh, vertices=scene.mesh.vertices + away)
    handles = tuple(
        dataclasses.replace(handle, origin=tuple(np.add(handle.origin, away).tolist()))
        if handle.name == "pin"
        else handle
        for handle in scene.handles
    )
    far = Simulation(dataclasses.replace(scene, mesh=mesh, handles=handles))
    press(far)
    np.testing.assert_allclose(far.result.reactions["pin"], near.result.reactions["pin"], rtol=2e-2, atol=1e-2)
    np.testing.assert_allclose(far.result.contacts["pin"].places - away, near.result.contacts["pin"].places, atol=1e-5)
