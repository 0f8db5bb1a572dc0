# SPDX-License-Identifier: Apache-2.0
"""Targets other than positions: orientations of probes and contact forces, alone and with positions."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.control import ForceTarget, InverseControl, OrientationTarget, Target
from gdfe_ros.control.stack import Stack
from gdfe_ros.errors import CommandError
from gdfe_ros.recording.message_tables import material_pose

PITCH = OrientationTarget(probe="tip", axes=(1,))
PLATE = {"obstacles": {"plate": {"plane": [0, 0, 1], "at": [0, 0, -0.03], "friction": 0.3}}, "solver.tolerance": 1e-4}
PRESSED = ForceTarget(contact="plate", axes=(2,), tolerance=0.02)


def finger(commands: dict[str, float], **overrides: object) -> Simulation:
    """Return the tendon finger at commands, solved to 1e-8 unless overridden."""
    simulation = Simulation(load_scene("tendon_finger", overrides={"solver.tolerance": 1e-8} | overrides))
    assert simulation.step(Command(actuators=commands)).converged
    return simulation


def slopes(simulation: Simulation, stack: Stack, name: str, step: float) -> np.ndarray:
    """Return central differences of a stack's values (t, 3) with respect to a command."""
    before, sides = simulation.snapshot(), []
    for sign in (step, -step):
        simulation.step(Command(actuators={name: simulation.commands[name] + sign}))
        sides.append(stack.values())
        simulation.restore(before)
    return (sides[0] - sides[1]) / (2.0 * step)


def test_turns_are_those_of_differences() -> None:
    """The exact derivatives of an orientation equal differences of equilibria to 1e-4."""
    simulation = finger({"flexor": 4.0, "extensor": 1.0})
    stack = Stack(simulation, [OrientationTarget(probe="tip", tolerance=1.0)], 1e-5)
    exact, differences = stack.jacobian(["flexor"])[:, 0], slopes(simulation, stack, "flexor", 2e-3)[0]
    assert np.abs(differences).max() > 1e-3
    np.testing.assert_allclose(exact, differences, rtol=0, atol=1e-4 * np.abs(differences).max())


def test_an_orientation_is_reached() -> None:
    """A pitch of the tip with a distance from the base is reached, measured by the probe's published pose."""
    simulation = finger({"flexor": 3.0, "extensor": 8.0})
    start = simulation.probe_positions()["tip"]
    control = InverseControl(simulation, [PITCH, Target(probe="tip", axes=(0,), weight=1e-4)])
    found = control.reach([[0.0, 0.6, 0.0], start])
    assert found.distances[0] < 0.01, found.message
    point = simulation.scene.probes["tip"]
    pose = material_pose(point, simulation.mesh.vertices, simulation.positions)
    np.testing.assert_allclose(pose.rotation, [0.0, 0.6, 0.0], atol=0.01)
    alone = InverseControl(simulation, [PITCH], actuators=["flexor"]).reach([[0.0, 0.3, 0.0]])
    assert alone.reached, alone.message
    assert alone.distances[0] < 1e-3


def test_a_contact_force_is_reached() -> None:
    """A contact force of 0.9 N on a plate is reached, and a simulation with the found commands has it too."""
    simulation = finger({"flexor": 4.0}, **PLATE)
    assert 0.0 < simulation.result.reactions["plate"][2] < 0.8
    found = InverseControl(simulation, [PRESSED], actuators=["flexor"]).reach([[0.0, 0.0, 0.9]])
    assert found.reached, found.message
    assert finger(found.commands, **PLATE).result.reactions["plate"][2] == pytest.approx(0.9, rel=0.04)


def test_a_force_without_contact_is_out_of_reach() -> None:
    """A contact force on a finger in the air leaves the finger, and the message gives a remedy."""
    simulation = finger({"extensor": 20.0}, **PLATE)
    before = simulation.positions.copy()
    found = InverseControl(simulation, [PRESSED]).reach([[0.0, 0.0, 0.3]])
    assert not found.reached
    assert "force of plate 0.3 N; nothing touches plate: bring the body there first" in found.message
    np.testing.assert_array_equal(simulation.positions, before)


def test_targets_of_nothing_are_refused() -> None:
    """Unknown probes and contacts, and invalid tolerances, are refused."""
    simulation = Simulation(load_scene("tendon_finger"))
    with pytest.raises(CommandError, match="no probe 'nail'; probes: tip"):
        InverseControl(simulation, [OrientationTarget(probe="nail")])
    with pytest.raises(CommandError, match="no obstacle or handle 'plate'; there are: base"):
        InverseControl(simulation, [ForceTarget(contact="plate")])
    with pytest.raises(ValueError, match="the tolerance of target 'force of plate' must be positive and finite"):
        ForceTarget(contact="plate", tolerance=0.0)
