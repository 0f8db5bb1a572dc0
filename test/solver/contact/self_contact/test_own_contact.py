# SPDX-License-Identifier: Apache-2.0
"""Self-contact: parts of a mesh that touch each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.constraints.obstacle import NAME
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.solver.settings import SolverSettings
from test.solver.contact.stacks import GAP, PRESSED, pressures, stack
from test.written import advance, scene_of

TUBE = """
mesh: {tube: {inner: 0.006, outer: 0.01, length: 0.02, cells: [2, 32, 8]}}
materials: {rubber: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1100}}
handles:
  low: {where: {box: {y: [-1, -0.0085]}}, fixed: true}
  top: {where: {box: {y: [0.0085, 1]}}}
self_contact: {friction: 0.3}
"""
SHOT = """
mesh: {bar: {size: [0.09, 0.03, 0.03], cells: [9, 3, 3], cut: [{box: {x: [0.03, 0.05]}}]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4, density: 1000}}
handles: {}
loads: {push: {surface: {where: {face: x-}, force: [0.63, 0, 0]}}}
self_contact: {}
dynamics: {step: 0.001}
"""


def pressed(simulation: Simulation, depth: float, *, slide: float = 0.0) -> StepResult:
    """Move the upper block down and sideways to displacements [m]; return the converged step."""
    return advance(simulation, Command(handles={"high": Pose((slide, 0.0, -depth))}))


@pytest.mark.parametrize(("low", "high"), [(4, 4), (4, 3), (2, 5)])
def test_pressure_is_uniform_where_blocks_are_pressed(low: int, high: int) -> None:
    """Two cubes pressed on each other have the same pressure at every vertex, within 1e-6, on any two meshes."""
    simulation = stack(low, high)
    result = pressed(simulation, PRESSED)
    for side in pressures(simulation, result):
        np.testing.assert_allclose(side, side.mean(), rtol=1e-6)
    assert result.iterations <= 5  # 196 with penalties and their updates
    alike = stack(4, 4)
    assert result.reactions["high"][2] == pytest.approx(pressed(alike, PRESSED).reactions["high"][2], rel=1e-6)


def test_what_acts_acts_back() -> None:
    """Contact forces sum to zero, and the forces on both handles too, with friction and on non-matching meshes."""
    simulation = stack(3, 4, friction=0.5)
    pressed(simulation, 0.004)
    result = pressed(simulation, 0.006, slide=0.004)
    touch = result.contacts[NAME]
    assert touch.presses.max() > 0.1
    np.testing.assert_allclose(touch.forces.sum(axis=0), 0.0, atol=1e-9 * touch.presses.sum())
    total = result.reactions["low"][:3] + result.reactions["high"][:3]
    np.testing.assert_allclose(total, 0.0, atol=2e-3 * np.abs(result.reactions["low"]).max())
    assert set(np.sign(simulation.mesh.vertices[touch.vertices, 2])) == {-1.0, 1.0}
    heights = simulation.mesh.vertices[:, 2]
    assert (heights[touch.vertices] * heights[touch.others] < 0.0).all()


def test_a_block_sticks_to_a_block_and_slips_beyond() -> None:
    """A block pushed sideways sticks like one body until friction reaches mu times the normal force, and then slips."""
    scenes = [stack(3, 3, friction=friction).scene for friction in (0.2, 50.0)]
    loose, tied = (Simulation(scene, settings=SolverSettings()) for scene in scenes)
    for simulation in (loose, tied):
        pressed(simulation, PRESSED)
    for way in (0.0005, 0.004):
        sticking = [pressed(simulation, PRESSED, slide=way) for simulation in (loose, tied)]
        assert not any(result.contacts[NAME].slips.any() for result in sticking)
        assert sticking[0].reactions["high"][0] == pytest.approx(sticking[1].reactions["high"][0], rel=0.01)
    touch = pressed(loose, PRESSED, slide=0.008).contacts[NAME]
    assert touch.slips.all()
    np.testing.assert_allclose(np.linalg.norm(touch.shears, axis=1), 0.2 * touch.presses, rtol=1e-3)
    assert not pressed(tied, PRESSED, slide=0.008).contacts[NAME].slips.any()


def test_what_slides_without_friction_is_where_it_is_said_to_be() -> None:
    """A frictionless block that slides over a block of other cells stays where a step ended if it is asked again.

    As the block slides, the normals under it turn, and all forces too: with penalties, a step took 500 to 4000
    iterations.
    """
    scene = stack(4, 3).scene
    simulation = Simulation(replace(scene, solver=replace(scene.solver, tolerance=1e-4, skip=())))
    for slide in (0.0, 0.002, 0.02):
        result = pressed(simulation, PRESSED, slide=slide)
        assert result.iterations < 100
        for _ in range(3):
            again = pressed(simulation, PRESSED, slide=slide)
            assert np.abs(again.positions - result.positions).max() < 1e-4 * simulation.mesh.size


def test_a_notch_closes_and_holds() -> None:
    """As its tendon is pulled, a finger's notches close and carry the added force; as it is released, they open."""
    simulation, tips = Simulation(load_scene("tendon_finger", overrides={"self_contact": {}})), {}
    for tension in (3.0, 6.0, 9.0, 12.0, 3.0):
        result = advance(simulation, Command(actuators={"flexor": tension}))
        tips[tension], touch = result.positions[-1], result.contacts[NAME]
        assert tension != 9.0 or result.iterations < 150
        assert touch.gaps.min(initial=0.0) > -1e-4 * simulation.mesh.size
        assert (len(touch.presses) > 10) == (tension > 3.0)
    assert np.linalg.norm(tips[12.0] - tips[9.0]) < 0.05 * np.linalg.norm(tips[6.0] - tips[3.0])
    assert result.min_det > 0.0


def test_a_tube_is_pressed_flat_node_on_node() -> None:
    """A tube whose wall meets itself, vertex on vertex, is pressed flat in few iterations, with friction."""
    simulation, iterations = Simulation(scene_of(TUBE)), 0
    for k in range(1, 29):
        result = advance(simulation, Command(handles={"top": Pose((0.0, -5e-4 * k, 0.0))}))
        iterations += result.iterations
    assert result.contacts[NAME].presses.sum() > 10.0
    assert iterations < 400  # more than 4000 with penalties and their updates


@pytest.mark.parametrize(("scheme", "swing"), [("newmark", 1e-6), ("generalised_alpha", 0.015), ("bdf2", 1e-6)])
def test_two_soft_bodies_collide(scheme: str, swing: float) -> None:
    """A pushed block hits a floating one: momentum stays to 0.1 %, and energy does not grow.

    Generalised alpha balances forces between the ends of a step: the energy at the ends oscillates as blocks separate.
    """
    simulation, totals, touched = Simulation(scene_of(SHOT, overrides={"dynamics.scheme": scheme})), [], []
    for step in range(150):
        result = advance(simulation, Command(loads={"push": 1.0 if step < 30 else 0.0}))
        momentum = (simulation.stepper.mass @ result.velocities).sum(axis=0)
        touched.append(len(result.contacts[NAME].presses))
        totals.append((momentum, result.energies["kinetic"] + result.energies["elastic"]))
    before, after = totals[40], totals[-1]
    assert not any(touched[:41])
    assert any(touched)
    assert not touched[-1]
    np.testing.assert_allclose(after[0], before[0], atol=1e-3 * np.abs(before[0]).max())
    left = simulation.mesh.vertices[:, 0] < 0.04
    assert result.velocities[~left, 0].mean() > 2.0 * abs(result.velocities[left, 0].mean())
    assert max(energy for _, energy in totals[40:]) < before[1] * (1.0 + swing)
    assert after[1] < before[1]
    assert after[1] > 0.5 * before[1] or scheme == "bdf2"


def test_parts_that_approach_in_the_same_array_are_seen() -> None:
    """The room between two parts shrinks as they approach, also where the caller moves them within one array."""
    simulation = stack(2, 2)
    state, actuation = simulation.state, simulation.stepper.actuation
    actuation.begin(state.commands, state.terms, state.positions, state.poses, state)
    own, positions = actuation.contacts[-1], state.positions.copy()
    own.follow(positions, np.inf)
    room, upper = own.room(positions), positions[:, 2] > 0.0
    positions[upper, 2] -= 0.4 * GAP
    assert own.room(positions) == pytest.approx(room - 0.2 * GAP, rel=1e-6)  # both parts move relative to their mean
