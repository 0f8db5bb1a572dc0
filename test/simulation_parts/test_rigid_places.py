# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies that a command puts at another pose in the middle of a motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.errors import CommandError, OverlapError, SceneError
from gdfe_ros.simulation_parts.soft_places import fit_rigidly
from gdfe_ros.solver.motion.inertia import mass_matrix
from test.written import advance, scene_of

CUSHION = """
mesh: {bar: {size: [0.1, 0.1, 0.04], cells: [5, 5, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
handles: {base: {where: {face: z-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
bodies: {part: {box: {size: [0.04, 0.03, 0.02]}, density: 1500, at: [0.05, 0.0, 0.031], friction: 0.5}}
dynamics: {scheme: bdf2, step: 0.005, damping: {viscosity: 100}}
"""
WEIGHT = 9.81 * 1500 * 0.04 * 0.03 * 0.02
FAR = Pose((0.5, 0.1, 2.0), (0.1, 0.2, 0.3))


def cushion(scheme: str = "bdf2", steps: int = 40) -> Simulation:
    """Return a box after some steps on a soft cushion."""
    simulation = Simulation(scene_of(CUSHION, overrides={"dynamics.scheme": scheme}))
    advance(simulation, count=steps)
    return simulation


@pytest.mark.parametrize(("scheme", "rel"), [("newmark", 1e-4), ("generalised_alpha", 1e-4), ("bdf2", 0.03)])
def test_what_is_put_somewhere_falls_from_there(scheme: str, rel: float) -> None:
    """A box put above its cushion falls by g t^2 / 2 from there, in the commanded rotation, and the cushion rises."""
    simulation = cushion(scheme)
    low = simulation.positions[:, 2].min(), simulation.positions[:, 2].max()
    result = advance(simulation, Command(bodies={"part": FAR}))
    assert not result.reactions["part"].any()
    advance(simulation, count=39)
    pose = simulation.handle_pose("part")
    assert pose.translation[2] - 2.0 == pytest.approx(-0.5 * 9.81 * 0.2**2, rel=rel)
    np.testing.assert_allclose([*pose.translation[:2], *pose.rotation], [0.5, 0.1, *FAR.rotation], atol=1e-9)
    assert simulation.positions[:, 2].max() > low[1]


def test_putting_is_work() -> None:
    """Putting a falling box higher is counted as work, so that energies balance, and removes its velocity."""
    simulation = cushion("generalised_alpha", 2)
    stored = ("kinetic", "elastic", "potential", "dissipated")
    for _ in range(2):
        simulation.step(Command(bodies={"part": FAR}))
        advance(simulation, count=10)
        energies = simulation.result.energies
        balance = sum(energies[name] for name in stored) - energies["work"]
        assert abs(balance) < 1e-3 * energies["potential"]
    assert energies["work"] == pytest.approx(WEIGHT * 2.0, rel=0.05)


def test_putting_before_the_first_step_is_work_too() -> None:
    """Putting a box before the first step is counted as work too: the steps after it converge and energies balance."""
    simulation = cushion("generalised_alpha", 0)
    advance(simulation, Command(bodies={"part": Pose((0.0, 0.0, 0.5))}))
    advance(simulation, count=10)
    stored = sum(simulation.result.energies[name] for name in ("kinetic", "elastic", "potential", "dissipated"))
    assert stored == pytest.approx(simulation.result.energies["work"], abs=0.02 * WEIGHT * 0.5)


def test_who_puts_it_all_the_time_holds_it() -> None:
    """A box put at the same place in every step stays there; put back on the cushion, it rests on the cushion."""
    simulation = cushion(steps=0)
    for _ in range(5):
        simulation.step(Command(bodies={"part": FAR}))
        assert abs(simulation.handle_pose("part").translation[2] - 2.0) < 1e-3
    simulation.step(Command(bodies={"part": Pose((0.0, 0.0, -0.0009))}))
    advance(simulation, count=120)
    assert simulation.result.reactions["part"][2] == pytest.approx(-WEIGHT, rel=0.05)


def test_states_after_it_are_saved_to_the_bit() -> None:
    """A state saved after a put continues elsewhere with the same bits, also if no time has passed since the put."""
    first, second = cushion(), cushion(steps=0)
    first.step(Command(bodies={"part": Pose((0.01, 0.0, 0.002), (0.0, 0.0, 0.2))}))
    first.step(Command(bodies={"part": Pose((0.01, 0.0, 0.001))}), dt=0.0)
    load_state(second, save_state(first))
    for simulation in (first, second):
        advance(simulation, count=20)
    assert np.array_equal(first.positions, second.positions)
    assert first.handle_pose("part") == second.handle_pose("part")
    assert first.result.reactions["part"].any()


def test_wrong_places_are_refused() -> None:
    """A wrong body name, a handle's name or a pose out of reach is refused with the allowed values; the state stays."""
    simulation = cushion(steps=3)
    before = simulation.handle_pose("part")
    for bodies, match in (
        ({"prt": Pose()}, "no free body 'prt' in scene 'body'; bodies: part"),
        ({"base": Pose()}, "no free body 'base' in scene 'body'; bodies: part"),
        ({"part": (0, 0, 1)}, r"body 'part': the pose is \(0, 0, 1\); allowed: a Pose"),
        ({"part": Pose((0.0, 0.0, 1e4))}, "body 'part' is put .* body lengths and 0 turns away; at most 1000"),
    ):
        with pytest.raises(CommandError, match=match):
            simulation.step(Command(bodies=bodies))
    assert simulation.handle_pose("part") == before
    with pytest.raises(CommandError, match="no free body 'part' in scene 'bend5'; bodies: none"):
        Simulation(load_scene("bend5")).step(Command(bodies={"part": Pose()}))


def test_what_would_be_put_into_something_is_refused() -> None:
    """A put into a wall, a ball, another box or the cushion is refused with depth, name and remedy; nothing moves."""
    wall, ball = {"box": {"size": [0.01, 0.2, 0.2]}, "at": [0.2, 0.0, 0.0]}, {"sphere": {"radius": 0.002}}
    other = {"box": {"size": [0.02, 0.02, 0.02]}, "density": 1000, "at": [0.05, 0.0, 0.1]}
    more = {"obstacles": {"wall": wall, "ball": {**ball, "at": [-0.1, 0.0, 0.0]}}, "bodies.other": other}
    simulation = Simulation(scene_of(CUSHION, overrides=more))
    advance(simulation, count=3)
    before, time, tolerance = simulation.handle_pose("part"), simulation.time, " m inside of "
    for pose, match in (
        ((0.128, 0.0, 0.0), rf"body 'part' is 0.003{tolerance}obstacle 'wall'; remedy: shift it by \[-0.003, 0, 0\] m"),
        ((-0.15, 0.0, -0.029), rf"body 'part' is 0.01{tolerance}obstacle 'ball'"),
        ((0.0, 0.0, 0.054), rf"body 'part' is 0.006\d+{tolerance}body 'other'"),
        ((0.0, 0.0, -0.004), rf"body 'part' is 0.002\d+{tolerance}the soft body"),
        (
            (0.0, 0.0, -0.031),
            "body 'part' is inside of the soft body, between vertices of its surface; remedy: put it where",
        ),
    ):
        with pytest.raises(OverlapError, match=match):
            simulation.step(Command(bodies={"part": Pose(pose)}))
        assert (simulation.handle_pose("part"), simulation.time) == (before, time)
    simulation.step(Command(bodies={"part": Pose((0.125, 0.0, 0.0)), "other": Pose((0.0, 0.0, 0.5))}))
    assert simulation.result.converged
    assert not simulation.result.contacts["part on wall"].presses.max(initial=0.0) > 1e-9 * WEIGHT


def test_a_box_smaller_than_a_cell_is_not_put_between_vertices() -> None:
    """A box smaller than a cell is refused inside the cushion, though it contains no vertex, and accepted beside it."""
    small = {"bodies.part.box.size": [0.008, 0.006, 0.006], "bodies.part.at": [0.05, 0.0, 0.05]}
    simulation = Simulation(scene_of(CUSHION, overrides=small))
    with pytest.raises(OverlapError, match="inside of the soft body, between vertices of its surface; remedy"):
        simulation.step(Command(bodies={"part": Pose((0.0, 0.0, -0.04))}))
    assert simulation.step(Command(bodies={"part": Pose((0.0, 0.0, -0.026))})).converged


def test_bodies_that_begin_inside_of_something_are_refused() -> None:
    """A scene with a body that overlaps a floor or another body is refused by name; one without overlap is accepted."""
    floor = {"plane": [0, 0, 1], "at": [0, 0, 0.0195], "fixed": True}
    bar = {"box": {"size": [0.1, 0.01, 0.01]}, "density": 1000, "at": [0.05, 0.0, 0.1], "rotation_deg": [45, 0, 0]}
    cross = {**bar, "box": {"size": [0.01, 0.1, 0.01]}, "rotation_deg": [0, 45, 0]}
    for more, depth in (
        ({"obstacles": {"floor": {**floor, "at": [0, 0, 0.023]}}}, "body 'part' is 0.002 m inside of obstacle 'floor'"),
        ({"obstacles": {"floor": {**floor, "at": [0, 0, 0.021]}}}, ""),
        (
            {"bodies.bar": bar, "bodies.cross": {**cross, "at": [0.05, 0.0, 0.1135]}},
            r"body 'bar' is 0.00064\d* m inside of",
        ),
        ({"bodies.bar": bar, "bodies.cross": {**cross, "at": [0.05, 0.0, 0.1143]}}, ""),
    ):
        if depth:
            with pytest.raises(SceneError, match=depth):
                scene_of(CUSHION, overrides=more)
        else:
            scene_of(CUSHION, overrides=more)


SOFT = """
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [4, 1, 1]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.2]}}
loads: {weight: {gravity: [0, 0, -9.81]}}
self_contact: {}
dynamics: {step: 0.005, damping: {viscosity: 50}}
soft_bodies:
  gel: {bar: {size: [0.03, 0.03, 0.03], cells: [2, 2, 2]}, material: soft, at: [0.3, 0, -0.16],
    rotation_deg: [0, 0, 9]}
"""


def pressed() -> tuple[Simulation, slice]:
    """Return a soft cube while it is pressed against the floor after a fall, and its vertices."""
    simulation = Simulation(scene_of(SOFT))
    advance(simulation, count=40)
    first = simulation.scene.mesh.parts["gel"].first_vertex
    return simulation, slice(first, first + 27)


def test_a_soft_body_is_put_with_its_deformation() -> None:
    """All distances stay, the mean pose is the commanded one, strain energy stays, and the change is work."""
    simulation, gel = pressed()
    before, elastic = simulation.positions[gel].copy(), simulation.result.energies["elastic"]
    account = simulation.stepper.find_imbalance(simulation.state)
    others = simulation.positions[: gel.start].copy()
    place = Pose((0.1, 0.05, 0.5), (0.0, 0.3, 0.0))
    simulation.step(Command(bodies={"gel": place}), dt=0.0)
    after = simulation.positions[gel]
    sides = [np.linalg.norm(each[:, None] - each[None], axis=2) for each in (before, after)]
    assert sides[1] == pytest.approx(sides[0], abs=1e-12)
    assert elastic > 1e-6
    part = simulation.scene.mesh.parts["gel"]
    origin, axes = fit_rigidly(part.mesh.vertices, after)
    assert origin == pytest.approx(part.at + place.translation, abs=1e-12)
    assert axes == pytest.approx(Rotation.from_rotvec(place.rotation).as_matrix() @ part.rotation, abs=1e-12)
    assert np.array_equal(simulation.positions[: gel.start], others)
    energies = simulation.stepper.energies(simulation.state)
    assert energies["elastic"] == pytest.approx(elastic, rel=1e-9)
    assert simulation.stepper.find_imbalance(simulation.state) == pytest.approx(account, abs=1e-12)
    assert not simulation.stepper.velocities(simulation.state)[gel].any()


def test_a_soft_body_falls_from_its_new_place() -> None:
    """The centre of mass falls by g t^2 / 2 while the cube rings out of its deformation."""
    simulation, gel = pressed()
    simulation.step(Command(bodies={"gel": Pose((0.1, 0.05, 0.5))}), dt=0.0)
    part = simulation.scene.mesh.parts["gel"].mesh
    mass = np.asarray(mass_matrix(part.vertices, part.cells, np.full(8, 1000.0)).sum(axis=1)).ravel()
    start = np.average(simulation.positions[gel], axis=0, weights=mass)
    advance(simulation, count=20)
    moved = np.average(simulation.positions[gel], axis=0, weights=mass) - start
    assert moved == pytest.approx([0.0, 0.0, -0.5 * 9.81 * 0.1**2], abs=0.03 * 0.5 * 9.81 * 0.1**2)


def test_a_soft_body_is_not_put_where_something_is() -> None:
    """A place in the floor or in another soft body is refused, and the state is unchanged."""
    simulation, _ = pressed()
    state = simulation.state
    for place, text in ((Pose((-0.3, 0.0, 0.15)), "inside of 'mesh'"), (Pose((0.0, 0.0, -0.1)), "obstacle 'floor'")):
        with pytest.raises(OverlapError, match=text):
            simulation.step(Command(bodies={"gel": place}))
        assert simulation.state is state
    with pytest.raises(CommandError, match="no free body 'gal'"):
        simulation.step(Command(bodies={"gal": Pose()}))
