# SPDX-License-Identifier: Apache-2.0
"""Scenes with cells cut by their surface: solved, rebuilt without the file, refused where faces are needed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.errors import SceneError
from gdfe_ros.scene import scene_from_text
from test.written import advance

SCENE = """
name: rod
mesh: {{voxels: {{surface: rod.stl, cell: 0.005, cells: {cells}}}}}
materials: {{soft: {{law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}}}
regions: [{{material: soft}}]
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
loads: {{weight: {{gravity: [0, 0, -1]}}}}
{more}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the surface of a rod of 4 x 4 cubes whose outer cubes are filled to 70 %."""
    trimesh.creation.box((0.05, 0.017, 0.017)).export(tmp_path / "rod.stl")
    return tmp_path


def load(folder: Path, *, cells: str = "cut", more: str = "", **options: object):
    """Load the rod."""
    (folder / "scene.yaml").write_text(SCENE.format(cells=cells, more=more))
    return load_scene(folder / "scene.yaml", **options)


def test_a_rod_that_no_grid_line_bounds_weighs_and_sags_as_it_should(folder: Path) -> None:
    """A rod of 17 mm on cubes of 5 mm has its weight within 1 %, and the sag of a fitted mesh within 5 %."""
    scene = load(folder)
    result = advance(Simulation(scene))
    assert result.reactions["base"][2] == pytest.approx(0.05 * 0.017**2 * 1000, rel=0.01)
    bar = "bar: {size: [0.05, 0.017, 0.017], cells: [10, 4, 4]}"
    fitted = scene_from_text(
        SCENE.format(cells="cut", more="").replace("voxels: {surface: rod.stl, cell: 0.005, cells: cut}", bar)
    )
    sags = [lowest(scene, result.positions), lowest(fitted, Simulation(fitted).step().positions)]
    assert sags[0] == pytest.approx(sags[1], rel=0.05)
    with pytest.raises(SceneError, match="the cubes have 138% of the surface's volume"):
        load(folder, cells="whole")


def lowest(scene: object, positions: np.ndarray) -> float:
    """Return how far the end of the axis has moved down [m]."""
    rest = scene.mesh.vertices
    end = (rest[:, 0] > rest[:, 0].max() - 1e-9) & (np.abs(rest[:, 1:] - rest[:, 1:].mean(axis=0)) < 1e-3).all(axis=1)
    return float((rest - positions)[end, 2].mean())


INNER, OUTER, PRESSURE = 0.01, 0.02, 200.0
"""Inner and outer radius of a hollow ball [m], and the pressure in it [Pa]."""
BALL = """
name: ball
mesh: {{voxels: {{surface: ball.stl, cell: {cell}, cells: cut}}}}
{skin}
materials: {{soft: {{law: neo_hookean, young: 1.0e5, poisson: 0.45}}}}
regions: [{{material: soft}}]
handles: {{base: {{where: {{box: {{x: [-1, -0.0185]}}}}, fixed: true}}}}
actuators: {{air: {{chamber: {chamber}}}}}
"""


def hollow(folder: Path, *, detail: int = 4, flip: bool = False) -> trimesh.Trimesh:
    """Write the surface of a hollow ball; return its inner surface."""
    inside = trimesh.creation.icosphere(detail, INNER)
    if flip:
        inside.invert()
    trimesh.util.concatenate([trimesh.creation.icosphere(detail, OUTER), inside]).export(folder / "ball.stl")
    return inside


def blown(folder: Path, *, cell: float, flip: bool = False) -> float:
    """Pressurise a hollow ball; return the chamber's change of volume divided by Lame's."""
    inside = hollow(folder, flip=flip)
    (folder / "ball.yaml").write_text(BALL.format(cell=cell, skin="skin: {file: ball.stl}", chamber="{}"))
    simulation = Simulation(load_scene(folder / "ball.yaml"))
    before = simulation.actuator_states()["air"].extent
    assert before == pytest.approx(inside.volume * (-1.0 if flip else 1.0), rel=1e-5)
    result = advance(simulation, Command(actuators={"air": PRESSURE}))
    np.testing.assert_allclose(result.reactions["base"][:3], 0.0, atol=1e-3 * PRESSURE * np.pi * INNER**2)
    wide, poisson = OUTER**3, 0.45
    slope = (1.0 - 2.0 * poisson) * INNER + (1.0 + poisson) * wide / (2.0 * INNER**2)
    radial = PRESSURE * INNER**3 / (1.0e5 * (wide - INNER**3)) * slope
    return (simulation.actuator_states()["air"].extent - before) / (4.0 * np.pi * INNER**2 * radial)


def test_a_chamber_of_cut_cells_blows_up_as_it_should(folder: Path) -> None:
    """A hollow ball of cut cells has Lame's change of volume within 5 % at three cells per wall, at second order."""
    coarse, fine = (1.0 - blown(folder, cell=cell) for cell in (0.005, 0.0035))
    assert abs(fine) < 0.05
    assert np.log(coarse / fine) / np.log(0.005 / 0.0035) > 1.7
    assert 1.0 - blown(folder, cell=0.005, flip=True) == pytest.approx(coarse, rel=1e-4)


def test_a_chamber_of_cut_cells_is_rebuilt_without_its_file(folder: Path) -> None:
    """A pressurised ball rebuilt from its scene's text has the same positions to the bit."""
    hollow(folder, detail=3)
    (folder / "ball.yaml").write_text(BALL.format(cell=0.005, skin="skin: {file: ball.stl}", chamber="{}"))
    scene = load_scene(folder / "ball.yaml")
    (folder / "ball.stl").unlink()
    command = Command(actuators={"air": PRESSURE})
    first, second = (Simulation(each).step(command) for each in (scene, scene_from_text(scene.source)))
    np.testing.assert_array_equal(first.positions, second.positions)


@pytest.mark.parametrize(
    ("skin", "chamber", "expected"),
    [
        ("", "{}", r"air.*its pressure acts on the skin; remedy: `skin: "),
        ("skin: {file: ball.stl}", "{where: {face: x-}}", "would name faces of cut cells.*remedy: cavity, near"),
        ("skin: {file: ball.stl}", "{cavity: 1}", "there are: 0: .* m\\^3 near"),
        ("skin: {file: full.stl}", "{}", "no closed shell within another one"),
    ],
)
def test_a_chamber_that_no_skin_bounds_is_refused(folder: Path, skin: str, chamber: str, expected: str) -> None:
    """A chamber in cut cells without a skin, by faces, or of a wrong cavity is refused with its remedy."""
    hollow(folder, detail=2)
    trimesh.creation.icosphere(4, OUTER).export(folder / "full.stl")
    (folder / "ball.yaml").write_text(BALL.format(cell=0.005, skin=skin, chamber=chamber))
    with pytest.raises(SceneError, match=f"(?s:.*){expected}"):
        load_scene(folder / "ball.yaml")


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        (
            "obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -1]}}",
            "cells.*floor would act on the faces of cut cells(?s:.*)remedy: `skin: .* or cells: whole",
        ),
        (
            "self_contact: {}",
            "cells.*self_contact would act on the faces of cut cells(?s:.*)remedy: `skin: .* or cells: whole",
        ),
        ("solver: {policy: relative}", "policy.*cannot take .*cut cells; remedy: policy: energy"),
    ],
)
def test_what_acts_on_faces_is_refused(folder: Path, more: str, expected: str) -> None:
    """With cut cells, contact and the policy relative are refused with a remedy."""
    with pytest.raises(SceneError, match=expected):
        load(folder, more=more)


def test_a_traction_is_refused_and_a_force_is_taken(folder: Path) -> None:
    """A traction on cut cells is refused with its key and remedy; a force is accepted, and the base carries it."""
    with pytest.raises(SceneError, match=r"loads.pull.*traction.*give the whole `force`"):
        load(folder, overrides={"loads": {"pull": {"surface": {"where": {"face": "x+"}, "traction": [1.0, 0, 0]}}}})
    scene = load(folder, overrides={"loads": {"pull": {"surface": {"where": {"face": "x+"}, "force": [0.1, 0, 0]}}}})
    result = Simulation(scene).step(Command())
    assert result.reactions["base"][0] == pytest.approx(-0.1, rel=1e-4)


@pytest.mark.parametrize("where", [{"face": "z+"}, {"box": {"z": [0.0084, 0.0086]}}])
def test_a_traction_acts_on_the_skin(folder: Path, where: dict[str, object]) -> None:
    """A pressure on the top of a rod's skin has the force and moment of the true area."""
    press = {"where": where, "traction": [0.0, 0.0, -10.0]}
    skin = "skin: {file: rod.stl}"
    scene = load(folder, more=skin, overrides={"loads": {"press": {"surface": press}}})
    forces = scene.loads[0].forces(scene.mesh.vertices, scene.mesh.cells)
    total = 10.0 * 0.05 * 0.017
    np.testing.assert_allclose(forces.sum(axis=0), [0.0, 0.0, -total], atol=1e-12)
    top = np.array([0.0, 0.0, 0.0085])
    np.testing.assert_allclose(
        np.cross(scene.mesh.vertices, forces).sum(axis=0), np.cross(top, [0.0, 0.0, -total]), atol=1e-12
    )
    with pytest.raises(SceneError, match="not of a skin; allowed: face, box, sphere"):
        load(folder, more=skin, overrides={"loads": {"press": {"surface": {**press, "where": {"vertices": [1]}}}}})


def test_a_whole_force_selects_faces_of_cells_beside_a_skin(folder: Path) -> None:
    """A force on faces selected by vertices has the same vertex forces with a skin and without."""
    ids = load(folder).mesh.surface()[0].tolist()
    pull = {"loads": {"pull": {"surface": {"where": {"vertices": ids}, "force": [0.1, 0.0, 0.0]}}}}
    made = [load(folder, more=more, overrides=pull) for more in ("", "skin: {file: rod.stl}")]
    plain, skinned = (scene.loads[0].forces(scene.mesh.vertices, scene.mesh.cells) for scene in made)
    np.testing.assert_array_equal(plain, skinned)
    np.testing.assert_allclose(plain.sum(axis=0), [0.1, 0.0, 0.0], atol=1e-12)
