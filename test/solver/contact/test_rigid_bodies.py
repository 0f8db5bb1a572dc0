# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies that move freely."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import CommandError
from test.written import advance, simulate

CUSHION = """
mesh: {bar: {size: [0.1, 0.1, 0.04], cells: [10, 10, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
handles: {base: {where: {face: z-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.05], fixed: true, friction: 0.5}}
bodies: {part: {box: {size: [0.04, 0.03, 0.02]}, density: 1500, at: [0.05, 0.0, 0.031], friction: 0.5}}
dynamics: {scheme: bdf2, step: 0.005, damping: {viscosity: 100}}
"""
MASS = 1500 * 0.04 * 0.03 * 0.02


@pytest.fixture
def cushion() -> Callable[..., Simulation]:
    """Give a function that makes a rigid box above a soft cushion; keyword arguments override scene keys."""
    return partial(simulate, CUSHION)


def test_a_box_that_falls_freely_does_so_as_any_other(cushion: Callable[..., Simulation]) -> None:
    """Without contact a rigid box falls by g t^2 / 2 and does not turn."""
    simulation = cushion(bodies__part__at=[0.5, 0.0, 2.0], dynamics__scheme="newmark")
    advance(simulation, count=40)
    pose = simulation.handle_pose("part")
    assert pose.translation[2] == pytest.approx(-0.5 * 9.81 * 0.2**2, rel=1e-5)
    np.testing.assert_allclose([*pose.translation[:2], *pose.rotation], 0.0, atol=1e-9)


def test_what_lies_on_a_body_weighs_on_it(cushion: Callable[..., Simulation]) -> None:
    """A box comes to rest on a cushion, which it indents and which carries its weight."""
    simulation = cushion()
    advance(simulation, count=160)
    assert simulation.result.reactions["part"][2] == pytest.approx(-MASS * 9.81, rel=2e-2)
    assert -2e-3 < simulation.handle_pose("part").translation[2] < -1.05e-3
    assert simulation.positions.shape == simulation.mesh.vertices.shape


def test_a_box_lies_on_the_floor(cushion: Callable[..., Simulation]) -> None:
    """A tilted box falls beside the cushion, tumbles onto a face, and rests on the floor without penetrating it."""
    simulation = cushion(bodies__part__at=[0.3, 0.0, -0.02], bodies__part__rotation_deg=[10, 0, 0])
    advance(simulation, count=240)
    pose = simulation.handle_pose("part")
    assert -0.02 + pose.translation[2] == pytest.approx(-0.04, abs=1e-5)
    np.testing.assert_allclose(np.degrees(pose.rotation[:2]), [-10.0, 0.0], atol=0.05)
    assert simulation.result.contacts["part on floor"].presses.sum() == pytest.approx(MASS * 9.81, rel=1e-2)


def test_momentum_is_kept_in_a_collision(cushion: Callable[..., Simulation]) -> None:
    """A free soft block that hits a rigid box without gravity keeps the total momentum to 0.1 %."""
    simulation = cushion(
        handles={},
        loads={},
        obstacles={},
        dynamics={"scheme": "generalised_alpha", "step": 0.001, "velocity": [0.0, 0.0, 0.5]},
        bodies__part__at=[0.05, 0.0, 0.0335],
    )
    advance(simulation, count=60)
    stepper = simulation.stepper
    momentum = (stepper.mass @ stepper.velocities(simulation.state)).sum(axis=0)
    assert simulation.handle_pose("part").translation[2] > 0.01
    np.testing.assert_allclose(momentum, [0.0, 0.0, 0.4 * 0.5], atol=2e-4)


@pytest.mark.parametrize(("name", "at"), [("part", [0.05, 0.0, 0.031]), ("part on floor", [0.3, 0.0, -0.0399])])
def test_forces_do_the_work_of_rigid_motions(
    cushion: Callable[..., Simulation], virtual_work: Callable[..., np.ndarray], name: str, at: list[float]
) -> None:
    """The forces on a box, of a soft body or of the floor, do the work of gaps and slips in motions of the box."""
    simulation = cushion(bodies__part__at=at)
    advance(simulation, count=20)
    term = next(each for each in simulation.stepper.equilibrium.actuation.contacts if each.name == name)
    x = simulation.state.positions + 0.0
    x[:-4] += np.random.default_rng(5).normal(scale=1e-5, size=(len(x) - 4, 3))
    own, ways = x[-4:] - x[-4:].mean(axis=0), np.zeros((6, *x.shape))
    for axis, along in enumerate(np.eye(3)):
        ways[axis, -4:], ways[3 + axis, -4:] = along, np.cross(along, own)
    assert np.abs(virtual_work(term, x, ways)).max() > 0.01


def test_a_body_takes_no_commands(cushion: Callable[..., Simulation]) -> None:
    """A command for a body that moves freely is refused, and the error says why."""
    with pytest.raises(CommandError, match="'part' moves freely and follows no target"):
        cushion().step(Command(handles={"part": Pose((0.0, 0.0, 0.1))}))
