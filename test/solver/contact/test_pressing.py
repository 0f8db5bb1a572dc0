# SPDX-License-Identifier: Apache-2.0
"""Bodies pressed against obstacles, without friction."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.mesh.files.stored_mesh import pack_surface
from test.solver.contact.balls import ball_between_plates, hertz, tatara
from test.written import advance, scene_of, simulate

REFERENCE = Path(__file__).parents[2] / "data" / "reference" / "contact_block_on_ball.npz"
QUADRATIC = {0.012: 84.8, 0.016: 128.9, 0.02: 178.8}
"""Dict from displacement [m] to force [N]: quadratic elements on 16^3 cells, by the makers of the reference."""
BEAM = """
mesh: {bar: {size: [1.0, 0.005, 0.005], cells: [160, 1, 1]}}
materials: {steel: {law: linear, young: 1.0e8, poisson: 0.0, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.0225], fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
"""
NEEDLE = """
mesh: {bar: {size: [0.1, 0.02, 0.01], cells: [20, 4, 2]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}}}
obstacles: {needle: {capsule: {radius: 0.005, length: 0.05}, at: [0.09, 0, -0.0151], friction: 0.0}}
"""


def lift(simulation: Simulation, move: float) -> float:
    """Lift the ball to a displacement [m] and return its reaction [N]; the cube's top must carry the opposite force."""
    result = advance(simulation, Command(handles={"ball": Pose((0.0, 0.0, move))}))
    force = max(1.0, result.reactions["ball"][2])
    np.testing.assert_allclose(result.reactions["top"][:3], -result.reactions["ball"][:3], atol=2e-3 * force)
    return result.reactions["ball"][2]


def test_with_gaps_at_vertices_the_force_is_that_of_the_same_mesh(cube: Callable[..., Simulation]) -> None:
    """With gaps at vertices, the force on a cube of 16^3 cells is within 1 % of another code with the same cells."""
    simulation = cube(mesh__bar__cells=[16, 16, 16], obstacles__ball__gaps="vertices")
    with np.load(REFERENCE) as reference:
        forces = dict(zip(np.round(reference["moves"], 6), reference["force_16"], strict=True))
    for move in (0.006, 0.012, 0.02):
        assert lift(simulation, move) == pytest.approx(forces[move], rel=0.01)


def test_by_default_the_force_is_that_of_quadratic_elements(cube: Callable[..., Simulation]) -> None:
    """With the default mean gaps of faces, the force is within 2 % of quadratic elements on as many cells."""
    simulation = cube(mesh__bar__cells=[16, 16, 16])
    for move, force in QUADRATIC.items():
        assert lift(simulation, move) == pytest.approx(force, rel=0.02)


def test_a_mesh_of_a_ball_presses_as_the_ball(cube: Callable[..., Simulation]) -> None:
    """A triangle mesh of a ball gives the force of the exact ball within 0.7 %, in at most 1.5 times the iterations."""
    surface, solid = trimesh.creation.icosphere(subdivisions=5, radius=0.04), cube(mesh__bar__cells=[8, 8, 8])
    form = {"mesh": {"embedded": pack_surface(surface.vertices, surface.faces)}, "at": [0.05, 0, -0.09]}
    mesh, iterations = cube(mesh__bar__cells=[8, 8, 8], obstacles__ball=form), np.zeros(2)
    for move in (0.006, 0.012, 0.02):
        assert lift(mesh, move) == pytest.approx(lift(solid, move), rel=0.007)
        iterations += mesh.result.iterations, solid.result.iterations
    assert iterations[0] < 1.5 * iterations[1]


def test_nothing_enters_an_obstacle(cube: Callable[..., Simulation]) -> None:
    """At the end of each step no vertex is deeper in the ball than 1e-4 of the body's size."""
    simulation = cube(mesh__bar__cells=[8, 8, 8])
    for move in np.linspace(0.002, 0.02, 6):
        lift(simulation, move)
        deep = np.linalg.norm(simulation.positions - [0.05, 0.0, -0.09 + move], axis=1).min() - 0.04
        assert deep > -1e-4 * simulation.mesh.size


def test_forces_go_on_to_nothing_when_the_obstacle_leaves(cube: Callable[..., Simulation]) -> None:
    """After the ball leaves, the force is exactly zero and the cube is undeformed to within the tolerance."""
    simulation = cube()
    lift(simulation, 0.01)
    assert lift(simulation, -0.02) == 0.0
    assert np.abs(simulation.positions - simulation.mesh.vertices).max() < 1e-5 * simulation.mesh.size


def test_a_beam_that_lies_down_touches_where_theory_says() -> None:
    """A clamped beam that sags onto a floor first touches it at (72 E I H / q)^(1/4), within 3 %."""
    simulation = Simulation(scene_of(BEAM))
    for factor in np.linspace(0.1, 1.0, 6):
        result = advance(simulation, Command(loads={"weight": float(factor)}))
    touch = result.contacts["floor"]
    first = touch.places[touch.presses > 0.0][:, 0].min()
    assert first == pytest.approx((72.0 * 1e8 * 0.005**2 / 12 * 0.02 / 9810.0) ** 0.25, rel=0.03)


def test_a_pressed_ball_gives_way_as_theory_says() -> None:
    """The force on a ball between plates exceeds Hertz' theory by more than 3 %, and is below Tatara's first order."""
    for approach, force in ball_between_plates(cells=16, approaches=[0.002, 0.0035, 0.005]).items():
        assert 1.03 * hertz(approach) < force < tatara(approach)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_needle_that_presses_into_a_bar_takes_few_iterations(friction: float) -> None:
    """Normals that turn by large angles between steps of the minimisation do not keep it from converging."""
    simulation = Simulation(scene_of(NEEDLE, overrides={"obstacles.needle.friction": friction}))
    for move in np.linspace(0.002, 0.024, 12):
        result = advance(simulation, Command(handles={"base": Pose((0.0, 0.0, -float(move)))}))
        assert result.iterations <= 30


BESIDE_A_BOX = """
mesh: {grid: {x: [0, 0.0229, 0.055, 0.1], y: [-0.01, -0.0017, 0.01], z: [-0.01, -0.0054, 0.001, 0.01]}}
materials: {a: {law: linear, young: 1.0e5, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}}}
obstacles: {box: {box: {size: [0.03, 0.05, 0.02]}, at: [0.08978607, 0, -0.0205], rotation_deg: [0, 0, 20]}}
actuators: {cable: {cable: {points: [[0, 0, 0.005], [0.05, 0.002, 0.005], [0.095, 0, 0.004]], command: shortening}}}
loads: {weight: {gravity: [3.12424, 7.04253, -3.79770]}}
self_contact: {friction: 0.3}
solver: {tolerance: 1.0e-6}
"""


def test_a_box_ends_at_its_edges() -> None:
    """Only vertices on a box bear forces, and their sum is the reaction: none is carried beside the box.

    The plane through which a vertex had entered carried vertices 0.7 and 1.8 mm beside the box.
    """
    base = Pose((-0.0013498, 0.00073546, 2.2758e-05), (0.131935, 0.180173, -0.134706))
    poses, commands = {"base": base, "box": Pose((-0.00012857, 0.0, 0.00722184))}, {"cable": 0.00133737}
    simulation = simulate(BESIDE_A_BOX)
    result = advance(simulation, Command(handles=poses, actuators=commands, loads={"weight": 1.935148}))
    touch = result.contacts["box"]
    local = Rotation.from_euler("z", -20, degrees=True).apply(touch.places - [0.08965750, 0, -0.01327816])
    beyond = np.abs(local) - [0.015, 0.025, 0.01]
    assert touch.presses.sum() > 0.1
    assert np.abs(beyond.max(axis=1)).max() < 1e-6
    np.testing.assert_allclose(touch.forces.sum(axis=0), result.reactions["box"][:3], atol=1e-9)
