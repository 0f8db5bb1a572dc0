# SPDX-License-Identifier: Apache-2.0
"""Handles with free rotations: hinged, pinned and free ends against beam theory, and their saved state."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import SceneError
from test.written import advance, scene_of

LENGTH, EDGE, YOUNG = 0.2, 0.01, 1.0e6
STIFFNESS = YOUNG * EDGE**4 / 12.0
SCENE = """\
mesh: {{bar: {{size: [0.2, 0.01, 0.01], cells: [40, 2, 2]}}}}
materials: {{a: {{law: linear, young: 1.0e6, poisson: 0.3, density: 1000}}}}
handles:
  base: {{where: {{face: x-}}, free: [{base}]}}
  tip: {{where: {{face: x+}}, free: [{tip}]}}
loads: {{weight: {{{load}}}}}
"""
GRAVITY = "gravity: [0, 0, -1.0]"
LINE = 1000.0 * EDGE**2 * 1.0
"""Weight of the beam per length [N/m]."""
LEFT = 4.0 * STIFFNESS / LENGTH * 1e-4
"""Moment [N m] of an end turned by the error of one tolerance."""


def beam(base: str, tip: str, load: str = GRAVITY, **overrides: object) -> Simulation:
    """Return the beam with the given free axes of its two ends."""
    return Simulation(scene_of(SCENE.format(base=base, tip=tip, load=load), overrides=overrides or None))


def sag(simulation: Simulation) -> float:
    """Return the sag [m] of the middle."""
    middle = np.argmin(np.linalg.norm(simulation.mesh.vertices - [LENGTH / 2, 0.0, 0.0], axis=1))
    return float(-simulation.positions[middle, 2])


def test_beam_on_two_hinges_sags_by_theory() -> None:
    """A beam on two hinges sags by 5 q L^4 / (384 E I), with slopes q L^3 / (24 E I) and no moment at the hinges."""
    simulation = beam("ry", "x, ry")
    result = advance(simulation, Command(loads={"weight": 0.2}))
    assert sag(simulation) == pytest.approx(5 * 0.2 * LINE * LENGTH**4 / (384 * STIFFNESS), rel=0.01)
    slope = 0.2 * LINE * LENGTH**3 / (24 * STIFFNESS)
    for name, sign in (("base", 1.0), ("tip", -1.0)):
        turn = simulation.handle_pose(name).rotation
        assert turn[1] == pytest.approx(sign * slope, rel=0.01)
        assert turn[0] == turn[2] == 0.0
        assert abs(result.reactions[name][4]) < LEFT


def test_three_point_bending() -> None:
    """A beam on two hinges with a force P on its middle sags by P L^3 / (48 E I)."""
    load = "point: {at: [0.1, 0, 0], force: [0, 0, -0.002]}"
    simulation = beam("ry", "x, ry", load)
    assert simulation.step().converged
    assert sag(simulation) == pytest.approx(0.002 * LENGTH**3 / (48 * STIFFNESS), rel=0.01)


def test_pinned_column_buckles_at_eulers_load() -> None:
    """A pinned column shortened by 1 % carries the load pi^2 E I / L^2 times 1 + slope^2 / 8 as it bows out."""
    simulation = beam("ry", "ry")
    simulation.step(Command(loads={"weight": 0.01}))
    for part in range(1, 11):
        pose = Pose(translation=(-0.001 * LENGTH * part, 0.0, 0.0))
        result = advance(simulation, Command(handles={"tip": pose}, loads={"weight": 0.01}))
    slope = simulation.handle_pose("base").rotation[1]
    expected = np.pi**2 * STIFFNESS / LENGTH**2 * (1.0 + slope**2 / 8.0)
    assert abs(slope) > 0.15
    assert -result.reactions["tip"][0] == pytest.approx(expected, rel=0.02)


def test_free_handle_carries_a_load() -> None:
    """With its tip's handle free, a beam sags under its weight by q L^4 / (8 E I), with a slope of q L^3 / (6 E I)."""
    simulation = beam("", "x, y, z, rx, ry, rz", **{"solver.tolerance": 1e-5})
    result = advance(simulation, Command(loads={"weight": 0.1}))
    pose = simulation.handle_pose("tip")
    assert -pose.translation[2] == pytest.approx(0.1 * LINE * LENGTH**4 / (8 * STIFFNESS), rel=0.01)
    assert pose.rotation[1] == pytest.approx(0.1 * LINE * LENGTH**3 / (6 * STIFFNESS), rel=0.01)
    assert np.abs(result.reactions["tip"][:3]).max() < 2e-3 * 0.1 * LINE * LENGTH
    assert np.abs(result.reactions["tip"][3:]).max() < LEFT


def test_commands_about_other_axes_count() -> None:
    """A handle hinged about y and turned by 90 degrees about x twists the body and does not turn about y."""
    simulation = beam("", "ry", **{"loads.weight.gravity": [0, 0, 0]})
    pose = Pose(rotation=(np.pi / 2, 0.3, 0.0))
    result = advance(simulation, Command(handles={"tip": pose}))
    np.testing.assert_allclose(simulation.handle_pose("tip").rotation, (np.pi / 2, 0.0, 0.0), atol=1e-3)
    assert result.reactions["tip"][3] > 1e-4


def test_relative_policy_and_commands_about_free_axes_are_refused() -> None:
    """The relative policy with free rotations, and a command of a free axis, are refused with a remedy."""
    with pytest.raises(SceneError, match=r"cannot take weight, base; remedy: policy: energy"):
        beam("ry", "", **{"solver.policy": "relative"})
    program = "program: {duration: 1, handles: {tip: [{time: 1, rotation_deg: [0, 5, 0]}]}}"
    with pytest.raises(SceneError, match=r"ry is free and cannot be commanded; use 0 for ry"):
        scene_of(SCENE.format(base="", tip="ry", load=GRAVITY) + program)


def test_a_handle_that_is_fixed_cannot_turn() -> None:
    """A handle with ``fixed: true`` and free axes is refused."""
    with pytest.raises(SceneError, match=r"fixed: true and free axes exclude each other"):
        scene_of(SCENE.format(base="", tip="rx], fixed: true, free: [rx", load=GRAVITY).replace("free: [rx], ", ""))
