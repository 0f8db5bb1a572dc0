# SPDX-License-Identifier: Apache-2.0
"""Forces that contact points hold: their work, and Coulomb's cone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.mesh.files.stored_mesh import pack_surface

BALL = trimesh.creation.icosphere(subdivisions=4, radius=0.04)
MESH = {"mesh": {"embedded": pack_surface(BALL.vertices, BALL.faces)}}


@pytest.mark.parametrize("friction", [0.0, 0.1, 10.0])
@pytest.mark.parametrize("form", [{"sphere": {"radius": 0.04}}, {"box": {"size": [0.05, 0.05, 0.08]}}, MESH], ids="sbm")
def test_forces_do_the_work_of_gaps_and_slips(
    cube: Callable[..., Simulation], virtual_work: Callable[..., np.ndarray], form: dict, friction: float
) -> None:
    """The forces on sticking and slipping vertices do the work of their gaps and slips."""
    simulation = cube(obstacles__ball={**form, "friction": friction, "at": [0.05, 0, -0.09]})
    simulation.step(Command(handles={"ball": Pose((0.002, 0.001, 0.003))}))
    term, random = simulation.stepper.equilibrium.actuation.contacts[0], np.random.default_rng(4)
    ways = random.normal(size=(4, *simulation.positions.shape))
    forces = virtual_work(term, simulation.positions + 1e-5 * ways[0], ways)
    assert np.abs(forces).max() > 0.1


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


def test_a_search_leaves_the_forces_of_other_contacts() -> None:
    """A ball lies on a table in a few iterations a step, while a gripper above it searches for contact with itself."""
    simulation = Simulation(load_scene("ball_gripper", overrides={"dynamics.step": 0.005}))
    for _ in range(4):
        result = simulation.step(dt=0.005)
        assert result.converged
        assert result.iterations <= 15  # two thousand where the ball loses its support at each search
