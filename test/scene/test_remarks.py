# SPDX-License-Identifier: Apache-2.0
"""Remarks on a scene: schemes that slide where friction holds, cells too coarse for contact, pressure or walls."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.tetmesh import divide
from test.written import scene_of

BLOCK = """
mesh: {bar: {size: [0.04, 0.04, 0.02], cells: [3, 3, 2]}}
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.3, density: 1000}}
handles: {}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.01], friction: 0.38}}
"""
SPHERE = """
mesh: {sphere: {inner: INNER, outer: 0.02, cells: CELLS}}
materials: {m: {law: linear, young: 1.0e5, poisson: 0.3, density: 1000}}
handles: {pin: {where: {vertices: [0, 1, 2]}, fixed: true}}
actuators: {fill: {chamber: {near: [0, 0, 0], command: pressure}}}
"""
SCENES = sorted(path.stem for path in (Path(__file__).parents[2] / "config" / "scenes").glob("*.yaml"))


def _slope(scheme: str, friction: float = 0.38) -> Simulation:
    turn = math.radians(20.0)
    pull = [9.81 * math.sin(turn), 0.0, -9.81 * math.cos(turn)]
    text = BLOCK.replace("0.38", str(friction))
    return Simulation(scene_of(f"{text}loads: {{weight: {{gravity: {pull}}}}}\ndynamics: {{{scheme}}}\n"))


def _slid(simulation: Simulation) -> float:
    """Return the block's mean speed [m/s] from 0.5 to 1 s."""
    ways = [simulation.step(dt=0.005).positions[:, 0].mean() for _ in range(200)]
    return (ways[-1] - ways[99]) / 0.5


@pytest.mark.parametrize(
    ("scheme", "told"),
    [
        ("scheme: newmark", True),
        ("scheme: generalised_alpha, rho_inf: 1.0", True),
        ("scheme: generalised_alpha, rho_inf: 0.0", False),
        ("scheme: bdf2", False),
        ("step: 0.002", True),
        ("step: 0.002, rho_inf: 0.2", False),
        ("step: 0.002, damping: {viscosity: 200.0}", False),
    ],
)
def test_schemes_that_slide_where_friction_holds_are_remarked(scheme: str, told: bool) -> None:
    """A block on a slope stays with the schemes that the remark recommends, and slides with the others."""
    simulation = _slope(scheme)
    notes = [text for text in simulation.remarks() if "friction of floor" in text]
    assert bool(notes) is told
    assert all("remedy: dynamics.scheme: bdf2, or generalised_alpha with rho_inf 0" in text for text in notes)
    assert bool(_slid(simulation) > 1e-2) is told
    assert not any("friction of" in text for text in _slope(scheme, friction=0.0).remarks())


def _pressed(cells: int) -> Simulation:
    size, across = 0.06, 6 * cells
    return Simulation(
        scene_of(f"""
mesh: {{bar: {{size: [{size}, {size}, {0.5 * size}], cells: [{across}, {across}, {across // 2}]}}}}
materials: {{m: {{law: neo_hookean, young: 1.0e5, poisson: 0.3}}}}
handles: {{base: {{where: {{face: z-}}, fixed: true}}}}
obstacles: {{ball: {{sphere: {{radius: 0.01}}, at: [{0.5 * size}, 0, {0.25 * size + 0.010001}]}}}}
""")
    )


@pytest.mark.parametrize(("cells", "told"), [(1, True), (2, True), (3, False)])
def test_a_ball_of_few_cells_is_remarked(cells: int, told: bool) -> None:
    """For pressed balls of 1, 2 and 3 cells, the force is right within 8 % where there is no remark."""
    simulation = _pressed(cells)
    notes = simulation.remarks()
    assert bool(notes) is told
    assert all(
        "obstacles 'ball': its radius 0.01 m" in text and "at most a third of the radius" in text for text in notes
    )
    force = -simulation.step(Command(handles={"ball": Pose((0.0, 0.0, -1e-3))})).reactions["ball"][2]
    assert bool(abs(force / 0.541 - 1.0) < 0.08) is not told  # 0.541 N: the mean of 5 cells, at three places


@pytest.mark.parametrize(
    ("inner", "cells", "told"),
    [(0.01, [4, 1], True), (0.014, [4, 1], True), (0.016, [4, 1], False), (0.01, [8, 4], False)],
)
def test_a_thick_ball_of_few_cells_is_remarked(inner: float, cells: list[int], told: bool) -> None:
    """For inflated hollow balls, the cavity's growth is Lame's within 4 % where there is no remark."""
    simulation = Simulation(scene_of(SPHERE.replace("INNER", str(inner)).replace("CELLS", str(cells))))
    notes = [text for text in simulation.remarks() if "actuators 'fill': the cells around it are" in text]
    assert bool(notes) is told
    before, pressure = simulation.actuator_states()["fill"].extent, 200.0
    after = simulation.step(Command(actuators={"fill": pressure})).actuators["fill"].extent
    share = inner**3 / (0.02**3 - inner**3)
    wanted = pressure * share * (0.4 + 1.3 * 0.02**3 / (2.0 * inner**3)) / 1e5
    assert bool(abs((after / before - 1.0) / 3.0 / wanted - 1.0) > 0.05) is told


@pytest.mark.parametrize(("cells", "told"), [(10, False), (8, False), (6, True), (4, True)])
def test_a_thin_strip_of_flat_tetrahedra_is_remarked(cells: int, told: bool) -> None:
    """For a clamped strip of one layer under pressure, the deflection is right within 6 % where there is no remark."""
    mesh = divide(bar([0.02, 0.005, 0.001], [cells, max(1, round(cells / 4)), 1]))
    simulation = Simulation(
        scene_of(f"""
mesh: {{embedded: {pack_mesh(mesh)}}}
materials: {{m: {{law: neo_hookean, young: 1.0e6, poisson: 0.45}}}}
handles: {{a: {{where: {{face: x-}}, fixed: true}}, b: {{where: {{face: x+}}, fixed: true}}}}
loads: {{push: {{surface: {{where: {{face: z-}}, traction: [0, 0, 20.0]}}}}}}
solver: {{tolerance: 1.0e-6}}
""")
    )
    notes = [text for text in simulation.remarks() if "walls that are thin for their cells" in text]
    assert bool(notes) is told
    assert all("remedy: a smaller `size`, or `least_size: 0.001`" in text for text in notes)
    rise = float((simulation.step().positions - mesh.vertices)[:, 2].max())
    assert bool(abs(rise / 9.62e-5 - 1.0) > 0.06) is told  # 9.62e-5 m: bricks of 24 x 6 x 2


@pytest.mark.parametrize("name", SCENES)
def test_shipped_scenes_touch_with_cells_that_are_fine_enough(name: str) -> None:
    """No shipped scene has a remark on cells that are too coarse, or on a scheme that slides."""
    texts = Simulation(load_scene(name)).remarks()
    assert not [text for text in texts if "cells" in text or "friction of" in text]


@pytest.mark.parametrize(("height", "told"), [(-0.005, True), (-0.01, False)])
def test_a_motion_that_begins_inside_of_an_obstacle_is_told(height: float, *, told: bool) -> None:
    """A block that begins inside of the floor leaves it at a high velocity; one that begins on the floor rests."""
    floor = BLOCK.replace("at: [0, 0, -0.01]", f"at: [0, 0, {height}]")
    simulation = Simulation(scene_of(f"{floor}dynamics: {{step: 0.005}}\n"))
    assert any("inside of floor" in text for text in simulation.remarks()) is told
    assert bool((simulation.step(dt=0.005).velocities[:, 2] > 0.5).any()) is told


@pytest.mark.parametrize(("gaps", "told"), [("faces", True), ("vertices", False)])
def test_a_motion_that_begins_too_near_to_a_ball_for_its_faces_is_told(gaps: str, *, told: bool) -> None:
    """A tenth of a millimetre above a ball, the mean error of the faces around the nearest vertex exceeds its gap."""
    ball = f"{{sphere: {{radius: 0.03}}, at: [0.02, 0, -0.0401], gaps: {gaps}}}"
    text = BLOCK.replace("[3, 3, 2]", "[4, 4, 2]").replace(
        "{plane: [0, 0, 1], at: [0, 0, -0.01], friction: 0.38}", ball
    )
    simulation = Simulation(scene_of(f"{text}dynamics: {{step: 0.004}}\n"))
    assert any("inside of floor, or nearer" in each for each in simulation.remarks()) is told
    assert bool(simulation.step(dt=0.004).reactions["floor"].any()) is told
