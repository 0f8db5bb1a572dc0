# SPDX-License-Identifier: Apache-2.0
"""The energy balance of an increment: smooth paths pass, jumps are told, and what folds is not accepted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.torture.actuation import DRIVES, scene_text
from benchmarks.torture.bodies import Driver
from benchmarks.torture.snaps import JUMPED, LAWS, SHELLS
from gdfe_ros.constraints import Pose
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.balance import Balance
from gdfe_ros.solver.settings import Policy


def _spring(stretch: float, lost: float = 0.0) -> Balance:
    """Return the balance of a spring of 2 N/m, pulled by a plate along x."""
    wrench = {"tip": np.array([2.0 * stretch, 0.0, 0.0, 0.0, 0.0, 0.0])}
    return Balance(stretch**2 - lost, 0.0, {}, wrench, {"tip": Pose((stretch, 0.0, 0.0))}, {})


def test_a_spring_keeps_its_energy() -> None:
    """Pull a spring: the work is exact and nothing is lost; without a tenth of it, a short increment proves a jump."""
    work, doubt = _spring(1.0).work_to(_spring(1.1))
    assert work == pytest.approx(0.21)
    assert doubt == pytest.approx(0.01)
    assert not _spring(1.0).jumps_to(_spring(1.1))
    assert _spring(1.0).jumps_to(_spring(1.1, lost=0.1))
    assert not _spring(0.0).jumps_to(_spring(1.1, lost=0.1))


def test_moments_work_on_turns_in_world_axes() -> None:
    """Turn a plate further about another axis: the motion is that of the turn between, not of rotation vectors."""
    begin, end = (1.0, 0.4, -0.3), (1.01, 0.41, -0.28)
    turn = (Rotation.from_rotvec(end) * Rotation.from_rotvec(begin).inv()).as_rotvec()
    for axis in range(3):
        wrench = {"tip": np.eye(6)[3 + axis]}
        first, last = (Balance(0.0, 0.0, {}, wrench, {"tip": Pose(rotation=pose)}, {}) for pose in (begin, end))
        assert first.work_to(last)[0] == pytest.approx(turn[axis], abs=1e-6)


@pytest.mark.parametrize("name", ["tendon_finger", "gripper", "three_chamber_arm"])
def test_driven_scenes_balance(name: str) -> None:
    """Play a program in small steps: potential and slopes of cables, chambers and weights add up, no jump is told."""
    scene = load_scene(name)
    scene = dataclasses.replace(scene, solver=dataclasses.replace(scene.solver, tolerance=1e-6))
    simulation, last, worst = Simulation(scene), None, 0.0
    for _, result in zip(range(12), simulation.play(steps=40), strict=False):
        assert JUMPED not in result.message
        balance = simulation._engine._balance
        if last is not None and balance is not None:
            lost = last.energy + last.potential + last.work_to(balance)[0] - balance.energy - balance.potential
            worst = max(worst, abs(lost) / max(balance.energy, abs(balance.potential)))
        last = balance
    assert 0.0 < worst < 0.02


@pytest.mark.parametrize("name", SHELLS)
def test_snapping_through_is_told_once(name: str) -> None:
    """Load a shallow shell in small steps: exactly one step says that it jumped, and the next goes on."""
    shell = SHELLS[name]
    driver = Driver(shell.scene(LAWS["linear"](), 1e-6))
    told = [JUMPED in driver.step(loads={"push": share * shell.weight}).message for share in np.linspace(0.05, 1.0, 20)]
    assert sum(told) == 1
    assert driver.results[-1].converged


def test_nothing_is_left_inside_out() -> None:
    """Evacuate a ball far beyond reason: it stays at its last sound equilibrium, says so, and comes back."""
    simulation = Simulation(scene_from_text(scene_text(DRIVES["vacuum of 10 bar"], "linear", Policy.ENERGY)))
    result = simulation.step(Command(actuators={"a": -1e6}))
    assert not result.converged
    assert "inside out" in result.message
    assert result.min_det > 0.0
    assert -1e6 < simulation._engine.commands["a"] < 0.0
    back = simulation.step(Command(actuators={"a": 0.0}))
    assert back.converged
    assert np.abs(back.positions - simulation.mesh.vertices).max() < 1e-4 * simulation.mesh.size
