# SPDX-License-Identifier: Apache-2.0
"""Rigid balls, capsules and closed meshes that move freely."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from gdfe_ros import Simulation, load_scene
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.solver.contact.rigid_contact import RoundContact
from test.written import advance

G = 9.81
SCENE = """
name: ball_on_slope
mesh: {bar: {size: [0.02, 0.02, 0.02], cells: [1, 1, 1]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.3, density: 1000}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}}
obstacles: {slope: {plane: [0, 0, 1], at: [0, 0, -0.1], friction: 0.5, fixed: true}}
bodies: {ball: {sphere: {radius: 0.01}, density: 1000, at: [0, 0, -0.09], friction: 0.5}}
loads: {weight: {gravity: [0, 0, -9.81]}}
dynamics: {scheme: bdf2, step: 0.005}
"""
BALL, LYING = {"sphere": {"radius": 0.01}}, {"capsule": {"radius": 0.01, "length": 0.03}, "rotation_deg": [90, 0, 0]}
RADIUS = 0.01


@pytest.fixture
def on_slope() -> Callable[..., Simulation]:
    """Give a function that puts a body in contact with a slope of an angle [rad]; it takes overrides of scene keys."""

    def make(angle: float, body: dict[str, Any], friction: float = 0.5, **overrides: Any) -> Simulation:
        normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
        at = np.array([0.0, 0.0, -0.1]) + RADIUS * normal
        keys = {
            "obstacles.slope.plane": normal.tolist(),
            "obstacles.slope.friction": friction,
            "bodies.ball": {"density": 1000, "friction": friction, "at": at.tolist(), **body},
        }
        keys |= {name.replace("__", "."): value for name, value in overrides.items()}
        return Simulation(scene_from_text(SCENE, overrides=keys))

    return make


def run(simulation: Simulation, duration: float) -> None:
    """Make steps for a duration [s]; each must converge."""
    advance(simulation, count=round(duration / simulation.scene.dynamics.step))


def moved(simulation: Simulation) -> float:
    """Return the distance [m] of the body from its initial position."""
    return float(np.linalg.norm(simulation.handle_pose("ball").translation))


def test_a_ball_rolls_down_a_slope(on_slope: Callable[..., Simulation]) -> None:
    """A ball rolls with 5/7 g sin(angle) and stays on the slope; the error is of second order in the step."""
    angle, time, errors = np.radians(20.0), 0.3, []
    exact = 0.5 * 5.0 / 7.0 * G * np.sin(angle) * time**2
    for h in (0.005, 0.0025):
        simulation = on_slope(angle, BALL, dynamics__step=h)
        run(simulation, time)
        errors.append(moved(simulation) / exact - 1.0)
        away = np.dot(simulation.handle_pose("ball").translation, [np.sin(angle), 0.0, np.cos(angle)])
        assert abs(away) < 1e-4 * RADIUS
    assert abs(errors[1]) < 0.01
    assert 3.5 < errors[0] / errors[1] < 4.5


def test_a_capsule_rolls_as_its_moment_of_inertia_says(on_slope: Callable[..., Simulation]) -> None:
    """A capsule rolls with g sin(angle) / (1 + I / (m r^2)), where I is that of a cylinder and two half balls."""
    angle, time, r, length = np.radians(20.0), 0.2, RADIUS, 0.03
    cylinder, ball = np.pi * r**2 * length, 4.0 / 3.0 * np.pi * r**3
    inertia = (cylinder * r**2 / 2.0 + ball * 0.4 * r**2) / ((cylinder + ball) * r**2)
    simulation = on_slope(angle, LYING, dynamics__step=0.0025)
    run(simulation, time)
    assert moved(simulation) == pytest.approx(0.5 * G * np.sin(angle) / (1.0 + inertia) * time**2, rel=0.01)


@pytest.mark.parametrize(("friction", "spins"), [(0.0, False), (0.05, True)])
def test_a_ball_slides_where_friction_is_too_small(
    on_slope: Callable[..., Simulation], friction: float, spins: bool
) -> None:
    """Below mu = 2/7 tan(angle) a ball slips: a = g (sin - mu cos), and its spin grows by 5/2 mu g cos / r."""
    angle, time = np.radians(30.0), 0.1
    simulation = on_slope(angle, BALL, friction)
    run(simulation, time)
    wanted = 0.5 * G * (np.sin(angle) - friction * np.cos(angle)) * time**2
    assert moved(simulation) == pytest.approx(wanted, rel=5e-3)  # the first step is of first order
    turn = np.linalg.norm(simulation.handle_pose("ball").rotation)
    assert turn == pytest.approx(0.5 * 2.5 * friction * G * np.cos(angle) / RADIUS * time**2, rel=0.03, abs=1e-4)
    assert (turn > 0.1) == spins


@pytest.mark.parametrize("body", [BALL, LYING], ids=["ball", "capsule"])
def test_what_rests_carries_its_weight_and_stays(on_slope: Callable[..., Simulation], body: dict[str, Any]) -> None:
    """A ball or capsule stays on a level floor for a second to 1e-6 m, and the contact force equals its weight."""
    simulation = on_slope(0.0, body, solver__tolerance=1e-6)
    run(simulation, 1.0)
    assert moved(simulation) < 1e-6
    mass = next(each.mass for each in simulation.scene.handles if each.name == "ball")
    pushed = simulation.result.contacts["ball on slope"].forces.sum(axis=0)
    np.testing.assert_allclose(pushed, [0.0, 0.0, mass * G], atol=1e-3 * mass * G)


def test_forces_do_the_work_of_gaps_and_slips(
    on_slope: Callable[..., Simulation], virtual_work: Callable[..., np.ndarray]
) -> None:
    """The forces of a ball that lies on a body do the work of gaps and slips in motions of both."""
    simulation = on_slope(
        0.3, BALL, bodies__block={"box": {"size": [0.05, 0.05, 0.02]}, "density": 900, "at": [0.003, 0.0, -0.07]}
    )
    for _ in range(60):
        simulation.step()
    contacts = simulation.stepper.equilibrium.actuation.contacts
    contact = next(each for each in contacts if isinstance(each, RoundContact) and each.acts)
    random, x, ways = np.random.default_rng(3), simulation.state.positions, []
    for _ in range(10):
        ways.append(np.zeros_like(x))
        for own in (slice(-8, -4), slice(-4, None)):
            turned = np.cross(30.0 * random.normal(size=3), x[own] - x[own].mean(axis=0))
            ways[-1][own] = random.normal(size=3) + turned
    assert np.abs(virtual_work(contact, x, ways)).max() > 1e-3


def box_file(folder: Path, size: tuple[float, float, float], turn: float = 0.0) -> Path:
    """Write a box as an STL file in millimetres, rotated about z and away from the origin; return its path."""
    box = trimesh.creation.box(1000.0 * np.array(size))
    box.apply_transform(trimesh.transformations.rotation_matrix(turn, [0, 0, 1]))
    box.apply_translation([5.0, 2.0, 1.0])
    box.export(folder / "box.stl")
    return folder / "box.stl"


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_mesh_box_behaves_as_the_box(on_slope: Callable[..., Simulation], tmp_path: Path, turn: float) -> None:
    """A mesh of a box has the mass, inertia and motion of the box, whatever the origin and axes of its file are.

    Motions are compared without friction. With it, a box that lies on four corners is hyperstatic: the shares of the
    corners, and with them the moment of friction, depend on the order of the points.
    """
    size = (0.03, 0.02, 0.01)
    at, tilt = [0.0, 0.0, -0.085], [10.0, 25.0, 0.0]
    simple = on_slope(0.1, {"box": {"size": list(size)}, "at": at, "rotation_deg": tilt}, 0.0)
    file = box_file(tmp_path, size, turn)
    given = {"mesh": {"file": str(file), "scale": 0.001}, "at": [0.0, 0.0, 0.0]}
    meshed = on_slope(0.1, {**given, "at": [0.0, 0.0, 0.2], "rotation_deg": tilt}, 0.0)
    body = next(each for each in meshed.scene.handles if each.name == "ball")
    box = next(each for each in simple.scene.handles if each.name == "ball")
    assert body.mass == pytest.approx(box.mass, rel=1e-5)
    np.testing.assert_allclose(body.form.moments, box.form.moments, rtol=1e-5)
    if turn == 0.0:
        shift = np.subtract([*at[:2], at[2] + 0.2], body.origin)
        meshed = on_slope(0.1, {**given, "rotation_deg": tilt, "at": shift.tolist()}, 0.0)
        for each in (simple, meshed):
            run(each, 0.15)
        first, second = (each.handle_pose("ball") for each in (simple, meshed))
        np.testing.assert_allclose(first.translation, second.translation, atol=1e-6)
        np.testing.assert_allclose(first.rotation, second.rotation, atol=1e-4)
        assert np.linalg.norm(first.rotation) > 0.1


def test_a_bag_contains_the_surface(on_slope: Callable[..., Simulation], tmp_path: Path) -> None:
    """The scene text embeds the surface: a simulation from it, without the file, gives the same bits."""
    file = box_file(tmp_path, (0.03, 0.02, 0.01), 0.7)
    first = on_slope(0.1, {"mesh": {"file": str(file), "scale": 0.001}, "at": [0.0, 0.0, -0.07]})
    file.unlink()
    second = Simulation(scene_from_text(first.scene.source))
    for each in (first, second):
        run(each, 0.1)
    assert np.array_equal(first.positions, second.positions)
    assert np.array_equal(first.result.positions, second.result.positions)
    assert first.handle_pose("ball") == second.handle_pose("ball")


def test_a_ball_that_rolls_is_replayed_to_the_bit(on_slope: Callable[..., Simulation]) -> None:
    """Two runs, and a run continued from a snapshot, end at the same bits."""
    first, second = on_slope(0.3, BALL), on_slope(0.3, BALL)
    run(first, 0.1)
    kept = first.snapshot()
    run(first, 0.1)
    run(second, 0.2)
    assert first.handle_pose("ball") == second.handle_pose("ball")
    second.restore(kept)
    run(second, 0.1)
    assert first.handle_pose("ball") == second.handle_pose("ball")


def test_a_hand_holds_a_ball() -> None:
    """The fingers of `grasp` close on a ball instead of the box, and lift it."""
    ball = {"sphere": {"radius": 0.0165}, "density": 500, "at": [0.030, 0, -0.0385], "friction": 0.8}
    program = {
        "program.actuators.left": [{"time": 0.0, "value": 0}, {"time": 0.5, "value": 6.0}],
        "program.actuators.right": [{"time": 0.0, "value": 0}, {"time": 0.5, "value": 6.0}],
        "program.handles.wrist": [{"time": 0.6}, {"time": 1.0, "translation": [0, 0, 0.02]}],
        "program.duration": 1.2,
    }
    simulation = Simulation(load_scene("grasp", overrides={"bodies.part": ball, **program}))
    for result in simulation.play():
        assert result.converged, (result.time, result.message)
    assert simulation.handle_pose("part").translation[2] > 0.015
