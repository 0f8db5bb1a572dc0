# SPDX-License-Identifier: Apache-2.0
"""The augmented Lagrangian of contact gaps and friction."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.mesh.packing import pack_surface
from gdfe_ros.solver.contact import held_forces

BALL = trimesh.creation.icosphere(subdivisions=4, radius=0.04)
MESH = {"mesh": {"embedded": pack_surface(BALL.vertices, BALL.faces)}}


def touching(cube: Callable[..., Simulation], form: dict, friction: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions near an equilibrium in contact, and the contact term's real and integer parameters there."""
    simulation = cube(obstacles__ball={**form, "friction": friction, "at": [0.05, 0, -0.09]})
    simulation.step(Command(handles={"ball": Pose((0.002, 0.001, 0.003))}))
    term = simulation.stepper.equilibrium.actuation.contacts[0]
    away = np.random.default_rng(4).normal(scale=1e-4, size=simulation.positions.shape)
    return simulation.positions + away, term.reals, term.integers


@pytest.mark.parametrize("friction", [0.0, 0.1, 10.0])
@pytest.mark.parametrize("form", [{"sphere": {"radius": 0.04}}, {"box": {"size": [0.05, 0.05, 0.08]}}, MESH], ids="sbm")
def test_the_gradient_is_that_of_the_energy(cube: Callable[..., Simulation], form: dict, friction: float) -> None:
    """The forces equal central differences of the energy, for sticking and for slipping vertices."""
    x, reals, integers = touching(cube, form, friction)
    force, size = np.zeros_like(x), np.zeros(1)
    held_forces.contact_energy(x, reals, integers, force, size)
    assert np.abs(force).max() > 0.1
    for vertex, axis in np.argwhere(force != 0.0)[::3]:
        beside, energies = np.zeros_like(x), []
        beside[vertex, axis] = 1e-7
        for sign in (1, -1):
            energies.append(
                held_forces.contact_energy(x + sign * beside, reals, integers, np.zeros_like(x), np.zeros(1))
            )
        slope = (energies[0] - energies[1]) / 2e-7
        assert slope == pytest.approx(force[vertex, axis], abs=2e-5 * np.abs(force).max())


def test_shear_stays_within_the_cone(cube: Callable[..., Simulation]) -> None:
    """The friction force is at most mu times the normal force at every vertex, and equal to it at some."""
    simulation = cube(obstacles__ball__friction=0.2)
    for share in (0.5, 1.0):
        simulation.step(Command(handles={"ball": Pose((0.0, 0.01 * share, 0.01 * share))}))
    touch = simulation.result.contacts["ball"]
    on = touch.presses > 0.0
    shears = np.linalg.norm(touch.shears[on], axis=1)
    assert on.sum() >= 4
    assert (shears <= 0.2 * touch.presses[on] * (1 + 1e-2)).all()
    assert (shears > 0.2 * touch.presses[on] * (1 - 1e-2)).any()
