# SPDX-License-Identifier: Apache-2.0
"""Skins that touch each other, cells' faces, and themselves."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.constraints.obstacle import NAME
from gdfe_ros.solver.contact.self_contact.own_contact import OwnContact
from test.solver.contact.balls import press_on_ball, press_on_plate
from test.solver.contact.stacks import PRESSED, STACK
from test.written import advance

CUBE = 0.05
CUT = "{{voxels: {{surface: cube.stl, cell: {cell}, cells: cut}}, skin: {{file: cube.stl}}, at: [0, 0, {at}]}}"
BAR = "{{bar: {{size: [0.05, 0.05, 0.05], cells: [{count}, {count}, {count}]}}, at: [-0.025, 0, {at}]}}"
FINGER = """
mesh: {voxels: {surface: finger.stl, cell: 0.0027, cells: cut}}
skin: {file: finger.stl}
self_contact: {}
"""
TUBE = """
name: tube
mesh: {voxels: {surface: tube.stl, cell: 0.002, cells: cut}}
skin: {file: tube.stl}
materials: {rubber: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1100}}
regions: [{material: rubber}]
handles: {low: {where: {face: y-}, fixed: true}, top: {where: {face: y+}}}
self_contact: {friction: 0.5}
"""


def the_contact(simulation: Simulation) -> OwnContact:
    """Return the self-contact term."""
    return simulation.stepper.actuation.contacts[-1]


def stacked(folder: Path, low: str, high: str, *, friction: float = 0.0, turn: float = 0.0) -> Simulation:
    """Return two cubes of 50 mm with a gap of 0.2 mm, each described by an entry of ``meshes`` with a place ``at``."""
    cube = trimesh.creation.box((CUBE, CUBE, CUBE))
    cube.export(folder / "cube.stl")
    low, high = (entry.format(cell=0.0125, count=4, at=at) for entry, at in ((low, -0.0251), (high, 0.0251)))
    text = STACK.replace("mesh: {bar: {size: [0.05, 0.05, 0.1], cells: [2, 2, 2]}}", "")
    text = text.replace("low: {where: {face: z-}", "low: {where: {mesh: low, face: z-}")
    text = text.replace("high: {where: {face: z+}", "high: {where: {mesh: high, face: z+}")
    high = high[:-1] + f", rotation_deg: [0, 0, {turn}]}}"
    sensors = "sensors: {low: {where: {mesh: low}}, high: {where: {mesh: high}}}"
    (folder / "stack.yaml").write_text(f"{text}\nmeshes:\n  low: {low}\n  high: {high}\n{sensors}\n")
    overrides = {"self_contact": {"friction": friction}, "solver": {"tolerance": 1e-4 if friction else 1e-5}}
    return Simulation(load_scene(folder / "stack.yaml", overrides=overrides))


@pytest.mark.parametrize("cells", [8, 16])
def test_a_ball_presses_a_ball_like_a_plate(cells: int) -> None:
    """Two equal balls meet in a plane: the force is that of one ball on a rigid plate, within 3 %."""
    ball, plate = press_on_ball(cells), press_on_plate(cells)
    for share, force in plate.items():
        assert ball[share] == pytest.approx(force, rel=0.03)


@pytest.mark.parametrize(("low", "high", "turn"), [(CUT, CUT, 0.0), (CUT, BAR, 0.0), (BAR, CUT, 0.0), (CUT, CUT, 90.0)])
def test_a_cube_presses_a_cube(tmp_path: Path, low: str, high: str, turn: float) -> None:
    """Skins and faces press each other with the force of cubes that touch by their faces; all forces cancel."""
    simulation = stacked(tmp_path, low, high, turn=turn)
    result = advance(simulation, Command(handles={"high": Pose((0.0, 0.0, -PRESSED))}))
    assert -result.reactions["high"][2] == pytest.approx(25.658, rel=2e-3)
    touch = result.contacts[NAME]
    np.testing.assert_allclose(touch.forces.sum(axis=0), 0.0, atol=1e-9 * touch.presses.sum())
    pushes = [simulation.scene.sensors[name].wrench(result)[:3] for name in ("low", "high")]
    np.testing.assert_allclose(pushes[0], [0.0, 0.0, -25.658], atol=0.1)
    np.testing.assert_allclose(pushes[0] + pushes[1], 0.0, atol=1e-9)


def test_a_cube_drags_a_cube_like_one_of_faces(tmp_path: Path) -> None:
    """A cube with a skin sticks to another one, and then slips, with the forces of cubes that touch by their faces."""
    pairs = [stacked(tmp_path, entry, entry, friction=0.2) for entry in (CUT, BAR)]
    for aside, slips in ((0.0, False), (0.0005, False), (0.004, False), (0.008, True)):
        results = [each.step(Command(handles={"high": Pose((aside, 0.0, -PRESSED))})) for each in pairs]
        assert all(result.converged for result in results)
        assert [bool(result.contacts[NAME].slips.all()) for result in results] == [slips, slips]
        forces = [result.reactions["high"][:3] for result in results]
        np.testing.assert_allclose(*forces, atol=0.01 * np.abs(forces[1]).max())


@pytest.mark.parametrize("friction", [0.0, 0.05, 5.0])
def test_forces_do_the_work_of_gaps_and_slips_and_sum_to_nothing(
    tmp_path: Path, friction: float, virtual_work: Callable[..., np.ndarray]
) -> None:
    """The forces do the work of gaps and slips, sticking or slipping, and sum to zero to rounding."""
    simulation = stacked(tmp_path, CUT, BAR, friction=friction, turn=20.0)
    simulation.step(Command(handles={"high": Pose((0.0, 0.0, -0.003))}))
    simulation.step(Command(handles={"high": Pose((0.001, 0.0, -0.003))}))
    term, x = the_contact(simulation), simulation.state.positions
    x = x + np.random.default_rng(4).normal(scale=3e-5, size=x.shape)
    forces = virtual_work(term, x, np.random.default_rng(5).normal(size=(4, *x.shape)))
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-13 * np.abs(forces).sum())
    assert np.abs(forces).max() > 0.1


def test_no_point_is_paired_with_its_own_triangles(tmp_path: Path) -> None:
    """Points of a skin never touch triangles that have them as corners, although these may span several cells."""
    contact = the_contact(stacked(tmp_path, CUT, CUT, turn=30.0))
    topology = contact.surface
    starts, vertices = topology.near
    for face, quad in enumerate(topology.quads):
        near = vertices[starts[face] : starts[face + 1]]
        assert np.isin(quad, near).all()


def test_a_finger_of_one_skin_closes_its_notches(tmp_path: Path) -> None:
    """A notched finger of cut cells bends and closes like the finger of cubes from which its surface is taken."""
    cubes = Simulation(load_scene("tendon_finger", overrides={"self_contact": {}}))
    faces = cubes.mesh.surface()[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    trimesh.Trimesh(cubes.mesh.vertices, faces).export(tmp_path / "finger.stl")
    lines = Path("config/scenes/tendon_finger.yaml").read_text().splitlines()
    kept = [line for line in lines if "finger: {" not in line and line != "mesh:" and "web" not in line.split(";")[0]]
    (tmp_path / "finger.yaml").write_text("\n".join(kept) + FINGER)
    finger = Simulation(load_scene(tmp_path / "finger.yaml"))
    for tension in (3.0, 6.0, 9.0, 12.0):
        results = [each.step(Command(actuators={"flexor": tension})) for each in (cubes, finger)]
        assert results[1].converged, results[1].message
    tips = [each.probe_positions()["tip"] for each in (cubes, finger)]
    assert np.linalg.norm(tips[1] - tips[0]) < 1e-3
    presses = [0.5 * result.contacts[NAME].presses.sum() for result in results]
    assert presses[1] == pytest.approx(presses[0], rel=0.2)


def test_a_tube_is_pressed_flat(tmp_path: Path) -> None:
    """A tube that folds is free until its wall meets itself, rim on rim; no fold is taken for a penetration."""
    trimesh.creation.annulus(r_min=0.006, r_max=0.01, height=0.02, sections=48).export(tmp_path / "tube.stl")
    (tmp_path / "tube.yaml").write_text(TUBE)
    simulation, forces = Simulation(load_scene(tmp_path / "tube.yaml")), []
    for depth in (0.003, 0.006, 0.009, 0.0095, 0.010, 0.0105, 0.011, 0.0112, 0.0115, 0.012):
        result = advance(simulation, Command(handles={"top": Pose((0.0, -depth, 0.0))}))
        assert (result.contacts[NAME].presses.sum() > 0.0) == (depth > 0.0108)
        forces.append(-result.reactions["top"][1])
    assert all(low < high for low, high in pairwise(forces))


def test_what_lies_inside_is_told(tmp_path: Path) -> None:
    """A skin that was put inside of another one is named with its depth; cells that overlap beyond skins are not."""
    simulation = stacked(tmp_path, CUT, CUT)
    penetration, points = the_contact(simulation).penetration, the_contact(simulation).points
    x = simulation.mesh.vertices.copy()
    assert penetration.tell(points.at(x), 1e-6) == (0.0, "")
    x[simulation.mesh.parts["high"].first_vertex :, 2] -= 0.0032
    depth, text = penetration.tell(points.at(x), 1e-6)
    assert depth == pytest.approx(0.003, rel=1e-6)
    assert "mesh 'high' lies 0.003 m inside of mesh 'low'" in text or "mesh 'low' lies 0.003 m" in text
