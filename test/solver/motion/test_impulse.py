# SPDX-License-Identifier: Apache-2.0
"""Impulses of contacts: the published forces change momentum by what they say, and restitution sets the rebound."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import SceneError
from test.written import advance, scene_of

CUSHION = """
mesh: {bar: {size: [0.08, 0.08, 0.04], cells: [4, 4, 2]}}
materials: {soft: {law: neo_hookean, young: 5.0e4, poisson: 0.4, density: 1000}}
handles: {base: {where: {face: z-}, fixed: true}}
bodies: {ball: {sphere: {radius: 0.02}, density: 800, at: [0.01, 0, 0.0405], friction: 0.4}}
loads: {weight: {gravity: [0.5, 0, -9.81]}}
dynamics: {step: 0.005}
"""
FLOOR = """
mesh: {bar: {size: [0.05, 0.05, 0.05], cells: [1, 1, 1]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}}
bodies: {ball: {sphere: {radius: 0.02}, density: 800, at: [0.3, 0, 0.02]}}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.1], fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
dynamics: {step: 0.002}
"""
SCHEMES = [
    {"scheme": "bdf2"}, {"scheme": "newmark"}, *({"scheme": "generalised_alpha", "rho_inf": rho} for rho in (0, 0.8))
]  # fmt: skip


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_published_force_is_all_that_a_body_receives(scheme: dict) -> None:
    """In each step of a ball that falls and rolls on a cushion, force and weight times the step change its momentum."""
    simulation = Simulation(scene_of(CUSHION, overrides={"dynamics": {"step": 0.005, **scheme}}))
    mass = simulation.scene.handles[-1].mass
    momentum, touched = np.zeros(3), 0
    for _ in range(40):
        result = advance(simulation)
        now = mass * simulation.stepper.velocities(simulation.state)[-4:].mean(axis=0)
        force = -result.reactions["ball"][:3] + mass * np.array([0.5, 0.0, -9.81])
        np.testing.assert_allclose(now - momentum, 0.005 * force, atol=1e-4 * mass * 9.81 * 0.005)
        momentum, touched = now, touched + bool(result.reactions["ball"][:3].any())
    assert touched > 20


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_ball_rebounds_by_its_restitution(scheme: dict, restitution: float) -> None:
    """A ball rebounds to e^2 of the height of its fall to 2 %, with every scheme."""
    given = {"dynamics": {"step": 0.002, **scheme}, "bodies.ball.restitution": restitution}
    simulation, heights = Simulation(scene_of(FLOOR, overrides=given)), []
    for _ in range(220):
        advance(simulation)
        heights.append(0.1 + simulation.handle_pose("ball").translation[2])
    landed = int(np.argmax(np.array(heights) < 1e-6))
    assert landed > 0
    assert max(heights[landed:]) == pytest.approx(0.1 * restitution**2, abs=0.002)


@pytest.mark.parametrize("scheme", SCHEMES[1:])
def test_a_tumbling_box_rebounds_without_a_gain_of_energy(scheme: dict) -> None:
    """A box without friction that rebounds with e = 1, corner after corner, gains no energy, and no step fails."""
    box = {"box": {"size": [0.04, 0.03, 0.05]}, "density": 500, "at": [0.3, 0, 0], "rotation_deg": [30, 47, 11]}
    given = {"dynamics": {"step": 0.01, **scheme}, "bodies.ball": box, "obstacles.floor.restitution": 1.0}
    simulation = Simulation(scene_of(FLOOR, overrides=given))
    first, last = (advance(simulation, count=count).energies for count in (1, 119))
    assert last["kinetic"] + last["potential"] <= first["kinetic"] + first["potential"] + 1e-9


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_an_obstacle_that_moves_a_rigid_box_works_on_it(scheme: dict, direction: tuple[float, ...]) -> None:
    """A floor that suddenly moves at v, sideways or up, does the work m v^2 on a box, and m g times its height."""
    box = {"box": {"size": [0.04, 0.04, 0.04]}, "density": 500, "at": [0.3, 0, -0.08]}
    floor = {"plane": [0, 0, 1], "at": [0, 0, -0.1], "friction": 0.5}
    given = {"dynamics": {"step": 0.002, **scheme}, "bodies.ball": box, "obstacles.floor": floor}
    simulation, speed = Simulation(scene_of(FLOOR, overrides=given)), np.array(direction) * 0.2
    for number in range(50):
        result = advance(simulation, Command(handles={"floor": Pose(translation=tuple(speed * 0.002 * (number + 1)))}))
    mass = simulation.scene.handles[-1].mass
    raised = 9.81 * simulation.handle_pose("ball").translation[2]
    assert result.energies["work"] == pytest.approx(mass * (speed @ speed + raised), rel=0.02)
    velocities = simulation.stepper.velocities(simulation.state)[-4:]
    np.testing.assert_allclose(velocities, np.tile(speed, (4, 1)), atol=1e-6)


@pytest.mark.parametrize("given", [-0.1, 1.5])
def test_a_restitution_out_of_range_is_refused(given: float) -> None:
    """A restitution that is no ratio is refused by its key."""
    with pytest.raises(SceneError, match="restitution"):
        scene_of(FLOOR, overrides={"obstacles.floor.restitution": given})
