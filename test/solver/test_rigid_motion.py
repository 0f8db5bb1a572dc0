# SPDX-License-Identifier: Apache-2.0
"""The start of a step: a motion that is common to all handles is rigid, and a twist turns every section."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.scene import load_scene
from gdfe_ros.solver.stepping.path import on_path
from test.written import advance, scene_of

LENGTH = 0.2
SCENE = f"""
mesh: {{bar: {{size: [{LENGTH}, 0.05, 0.05], cells: [8, 3, 3]}}}}
materials: {{soft: {{law: neo_hookean, young: 1.0e5, poisson: 0.45}}}}
handles:
  base: {{where: {{face: x-}}}}
  tip: {{where: {{face: x+}}}}
actuators: {{tendon: {{cable: {{points: [[0.0, 0.0, 0.02], [{LENGTH}, 0.0, 0.02]], range: [0.0, 5.0]}}}}}}
"""


def together(turn: Sequence[float], *, extra: float = 0.0) -> dict[str, Pose]:
    """Return poses that turn the bar about its base, and stretch it by ``extra`` [m]."""
    arm = Rotation.from_rotvec(turn).apply([LENGTH + extra, 0.0, 0.0])
    return {"base": Pose(rotation=tuple(turn)), "tip": Pose(tuple(arm - [LENGTH, 0.0, 0.0]), tuple(turn))}


@pytest.mark.parametrize("turn", [(0.0, 1.56, 0.0), (0.0, np.pi, 0.0), (1.5, 1.8, 1.9), (0.0, 0.0, 2.0 * np.pi)])
def test_a_common_motion_takes_one_increment(turn: tuple[float, float, float]) -> None:
    """Without a strain, also about half a turn; along the line between both poses of the tip, the bar was crushed."""
    simulation = Simulation(scene_of(SCENE))
    result = simulation.step(Command(handles=together(turn)))
    assert (result.converged, result.substeps, result.iterations) == (True, 1, 0)
    assert result.energy == pytest.approx(0.0, abs=1e-12)


def test_a_deformed_body_turns_as_it_is() -> None:
    """A bar that a tendon has bent keeps its energy."""
    simulation = Simulation(scene_of(SCENE))
    bent = advance(simulation, Command(actuators={"tendon": 2.0}))
    turned = advance(simulation, Command(handles=together((0.0, 2.5, 0.5))))
    assert turned.energy == pytest.approx(bent.energy, rel=1e-6)


@pytest.mark.parametrize("turn", [0.0, 2.0 * np.pi])
def test_a_twist_by_a_whole_turn_is_no_common_motion(turn: float) -> None:
    """The tip's place is the same after a whole turn, but the bar is twisted."""
    simulation = Simulation(scene_of(SCENE))
    result = simulation.step(Command(handles={"tip": Pose(rotation=(turn, 0.0, 0.0))}))
    assert (result.energy > 1e-3) == (turn > 0.0)


def test_a_common_motion_with_a_stretch_is_none() -> None:
    """It ends at the same energy in one step as if the stretch came after the turn."""
    whole, halves = (Simulation(scene_of(SCENE)) for _ in range(2))
    goal = Command(handles=together((0.0, 1.0, 0.0), extra=0.02))
    found = whole.step(goal)
    halves.step(Command(handles=together((0.0, 1.0, 0.0))))
    assert found.energy == pytest.approx(halves.step(goal).energy, rel=1e-5)


def test_the_way_of_a_common_motion_is_rigid() -> None:
    """Where commands of actuators divide the way, the handles keep their distance."""
    began, goal = ({"base": Pose(), "tip": Pose()}, {}), (together((0.0, 2.0, 0.0)), {})
    centres = {"base": np.array([0.0, 0.0, 0.0]), "tip": np.array([LENGTH, 0.0, 0.0])}
    for share in (0.25, 0.5, 0.75):
        poses, _ = on_path(began, goal, share, centres)
        ends = [centres[name] + poses[name].translation for name in ("base", "tip")]
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(LENGTH, abs=1e-12)


@pytest.mark.parametrize("cells", [(12, 3, 3), (40, 10, 10)])
def test_a_twist_takes_few_iterations_on_every_mesh(cells: tuple[int, int, int]) -> None:
    """By 90 degrees in one step; from the handles' chords, a fine mesh took seven times as many as from their arcs."""
    simulation = Simulation(load_scene("twist90_uniform", overrides={"mesh.bar.cells": list(cells)}))
    program = simulation.scene.program
    result = advance(simulation, Command(handles=program.handle_poses(program.duration)))
    assert result.iterations <= 8
