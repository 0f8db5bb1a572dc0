# SPDX-License-Identifier: Apache-2.0
"""Contact at the points of a skin: a ball beside CalculiX, slopes in closed form, forces and moments to rounding."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.mesh.outside import hang
from gdfe_ros.mesh.surfaces.surface_edges import refine
from gdfe_ros.solver.contact.contact import Contact
from gdfe_ros.solver.contact.stencil import add_loads
from test.solver.contact.balls import CALCULIX, press_ball
from test.written import advance

SLAB = """
name: slab
mesh: {{bar: {{size: [0.10, 0.06, 0.02], cells: [5, 3, 1]}}}}
skin: {{file: slab.stl, contact: true}}
materials: {{soft: {{law: neo_hookean, young: 5.0e5, poisson: 0.4, density: 1000}}}}
regions: [{{material: soft}}]
handles: {{}}
obstacles: {{slope: {{plane: [0, 0, 1], at: [0, 0, -0.01], friction: {friction}}}}}
loads: {{weight: {{gravity: [{along}, 0, {down}]}}}}
dynamics: {{scheme: bdf2, step: 0.01}}
{more}
"""
ANGLE = np.radians(30.0)


def slab(folder: Path, friction: float, more: str = "") -> Simulation:
    """Return a slab on a slope whose contact points are those of its surface mesh."""
    box = trimesh.creation.box((0.10, 0.06, 0.02)).apply_translation([0.05, 0.0, 0.0])
    box.export(folder / "slab.stl")
    weight = {"along": 9.81 * np.sin(ANGLE), "down": -9.81 * np.cos(ANGLE)}
    (folder / "slab.yaml").write_text(SLAB.format(friction=friction, more=more, **weight))
    return Simulation(load_scene(folder / "slab.yaml"))


def test_a_ball_between_plates_is_calculix_ball() -> None:
    """The force on a cut ball between plates is within 5 % of CalculiX at 12 cells per diameter.

    The error at 12 cells is less than half of the error at 8 cells.
    """
    coarse, fine = (press_ball(count, "skin") for count in (8, 12))
    misses = [max(abs(each[share] / wanted - 1.0) for share, wanted in CALCULIX.items()) for each in (coarse, fine)]
    assert misses[1] < 0.05
    assert misses[1] < 0.5 * misses[0]


PRESSED = """
name: pressed
mesh: {{voxels: {{surface: body.stl, cell: 0.01, cells: cut}}}}
skin: {{file: body.stl}}
materials: {{soft: {{law: neo_hookean, young: {young}, poisson: 0.4, density: 1000}}}}
regions: [{{material: soft}}]
handles: {handles}
obstacles: {{floor: {{plane: [0, 0, 1], at: [0, 0, {floor}], friction: {friction}}}}}
{more}
"""


def pressed(folder: Path, body: trimesh.Trimesh, *, young: float = 1e5, friction: float = 0.0) -> tuple[float, float]:
    """Press the upper half of a cut body down by a tenth of its height.

    Returns the skin's penetration divided by the displacement, and the least volume ratio.
    """
    body.export(folder / "body.stl")
    low, high = body.bounds[:, 2]
    handles = f"{{top: {{where: {{box: {{z: [{low + 0.55 * (high - low)}, 1]}}}}}}}}"
    text = PRESSED.format(young=young, handles=handles, floor=low, friction=friction, more="")
    (folder / "body.yaml").write_text(text)
    simulation, approach = Simulation(load_scene(folder / "body.yaml")), 0.1 * (high - low)
    result = advance(simulation, Command(handles={"top": Pose((0.0, 0.0, -approach))}))
    mesh = simulation.mesh
    points, _ = refine(np.asarray(body.vertices), np.asarray(body.faces), 0.01 / 6.0)
    cells, weights = hang(mesh.vertices, mesh.cells, points)
    heights = np.einsum("ka,ka->k", weights, result.positions[mesh.cells[cells], 2])
    return (low - heights.min()) / approach, result.min_det


@pytest.mark.parametrize(("share", "turn"), [(0.15, 0.0), (0.4, 0.0), (0.6, 0.0), (0.75, 0.0), (0.45, 0.5)])
def test_flat_sides_enter_nothing_however_full_their_cells_are(tmp_path: Path, share: float, turn: float) -> None:
    """Flat sides with partly filled cells, or turned in the grid, penetrate by at most 2 % of the displacement."""
    body = trimesh.creation.box((np.array([4, 4, 3]) + 2.0 * share) * 0.01)
    body.apply_transform(trimesh.transformations.rotation_matrix(turn, [0, 0, 1]))
    depth, least = pressed(tmp_path, body)
    assert depth < 0.02
    assert least > 0.5


def cone(radius: float, sections: int) -> trimesh.Trimesh:
    """Return a cone of 60 mm that stands on its tip."""
    body = trimesh.creation.cone(radius=radius, height=0.06, sections=sections)
    return body.apply_transform(trimesh.transformations.rotation_matrix(np.pi, [1, 0, 0]))


@pytest.mark.parametrize("sections", [12, 24, 48])
def test_a_blunt_tip_touches(tmp_path: Path, sections: int) -> None:
    """The tip of a cone without sharp edges is a contact point, however many sides the cone has."""
    assert pressed(tmp_path, cone(0.036, sections))[0] < 0.02


def test_a_tip_beyond_the_cells_touches(tmp_path: Path) -> None:
    """The tip of a cone, in cubes too empty to be cells, carries contact and enters nothing."""
    body = cone(0.02, 32)
    depth, least = pressed(tmp_path, body)
    assert load_scene(tmp_path / "body.yaml").mesh.vertices[:, 2].min() > body.bounds[0, 2] + 0.009
    assert depth < 0.02
    assert least > 0.5


@pytest.mark.parametrize("young", [3e4, 1e5])
def test_a_soft_ball_of_cut_cells_falls_and_jumps(tmp_path: Path, young: float) -> None:
    """A cut ball of 8 cells per diameter falls by ten centimetres and bounces back; every step converges."""
    radius, fall = 0.04, 0.10
    trimesh.creation.icosphere(4, radius).export(tmp_path / "body.stl")
    more = "loads: {weight: {gravity: [0, 0, -9.81]}}\ndynamics: {scheme: bdf2, step: 0.005}"
    text = PRESSED.format(young=young, handles="{}", floor=-radius - fall, friction=0.5, more=more)
    (tmp_path / "body.yaml").write_text(text)
    simulation, heights = Simulation(load_scene(tmp_path / "body.yaml")), []
    for _ in range(50):
        advance(simulation)
        heights.append(simulation.positions[:, 2].mean())
    lowest = int(np.argmin(heights))
    assert heights[lowest] < -fall - 0.1 * radius
    assert heights[-1] > -fall + 0.2 * radius


@pytest.mark.parametrize("friction", [0.2, 0.4])
def test_a_slab_slides_as_coulomb_says(tmp_path: Path, friction: float) -> None:
    """After it has settled, a slab slides down a slope with g (sin - mu cos)."""
    simulation, places = slab(tmp_path, friction), []
    for _ in range(40):
        assert simulation.step().converged
        places.append(simulation.positions[:, 0].mean())
    acceleration = np.polyfit(0.01 * np.arange(20), places[20:], 2)[0] * 2.0
    assert acceleration == pytest.approx(9.81 * (np.sin(ANGLE) - friction * np.cos(ANGLE)), rel=0.01)


def test_a_slab_sticks_without_creeping(tmp_path: Path) -> None:
    """A slab at rest on a rough slope moves by less than a nanometre in a tenth of a second."""
    simulation = slab(tmp_path, 0.8, "solver: {tolerance: 1.0e-7}")
    for _ in range(150):
        simulation.step()
    before = simulation.positions.copy()
    for _ in range(10):
        result = simulation.step()
    assert np.abs(simulation.positions - before).max() < 1e-9
    assert not result.contacts["slope"].slips[result.contacts["slope"].presses > 0.0].all()


def test_what_a_skin_pushes_is_what_the_body_feels(tmp_path: Path) -> None:
    """The vertex forces of a skin contact have the force and moment of its wrench, to rounding."""
    simulation = slab(
        tmp_path, 0.5, "bodies: {lid: {box: {size: [0.04, 0.04, 0.01]}, density: 2000, at: [0.05, 0, 0.015]}}"
    )
    for _ in range(8):
        simulation.step(Command(handles={"slope": Pose((0.001, 0.0, 0.0004), (0.01, 0.01, 0.0))}))
    terms = [term for term in simulation.stepper.actuation.contacts if type(term) is Contact]
    state = simulation.state
    for term in terms:
        simulation.stepper.actuation.begin(state.commands, state.terms, state.positions, state.poses, state, ratio=0.0)
        slopes = np.zeros_like(state.positions)
        add_loads(term.stencils, slopes)
        forces = -slopes
        wrench, count = term.wrench(state.positions), simulation.mesh.n_vertices
        assert np.abs(wrench).max() > 0.1
        arms = state.positions[:count] - term._origin
        felt = np.concatenate([forces[:count].sum(axis=0), np.cross(arms, forces[:count]).sum(axis=0)])
        np.testing.assert_allclose(felt, wrench, rtol=1e-9, atol=1e-9)
        if len(forces) > count and term.name == "lid":
            np.testing.assert_allclose(forces[count:].sum(axis=0), -wrench[:3], atol=1e-9)


def test_forces_do_the_work_of_gaps_and_slips(tmp_path: Path, virtual_work: Callable[..., np.ndarray]) -> None:
    """The forces of a skin contact do the work of gaps and slips."""
    more = "bodies: {lid: {box: {size: [0.04, 0.04, 0.01]}, density: 2000, at: [0.05, 0, 0.015], friction: 0.5}}"
    simulation = slab(tmp_path, 0.5, more)
    for _ in range(8):
        simulation.step(Command(handles={"slope": Pose((0.001, 0.0, 0.0004))}))
    state, rng = simulation.state, np.random.default_rng(2)
    actuation = simulation.stepper.actuation
    actuation.begin(state.commands, state.terms, state.positions, state.poses, state, ratio=0.0)
    for term in actuation.contacts:
        if type(term) is not Contact:
            continue
        way = rng.normal(size=state.positions.shape)
        way[simulation.mesh.n_vertices :] = 0.0  # the lid stays rigid
        assert np.abs(virtual_work(term, state.positions + 1e-6 * way, [way])).max() > 0.01
