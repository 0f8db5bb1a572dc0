# SPDX-License-Identifier: Apache-2.0
"""Scenes with contact by a skin: rolling rods, sensors, several meshes, rigid bodies, bags, and refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.errors import SceneError
from gdfe_ros.results.contacts import contact_points
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.scene import Scene
from test.written import advance

RADIUS, LENGTH = 0.01, 0.03
SLOPE = np.radians(20.0)
ROD = """
name: rod
mesh: {{voxels: {{surface: rod.stl, cell: {cell}, cells: {cells}}}}}
{skin}
materials: {{soft: {{law: neo_hookean, young: 5.0e5, poisson: 0.4, density: 1000}}}}
regions: [{{material: soft}}]
handles: {handles}
obstacles: {{floor: {{plane: [0, 0, 1], at: [0, 0, -0.01005], friction: 0.6}}}}
{more}
"""
ROLLS = f"""
loads: {{weight: {{gravity: [0, {9.81 * np.sin(SLOPE)}, {-9.81 * np.cos(SLOPE)}]}}}}
dynamics: {{scheme: bdf2, step: 0.01}}
"""
HELD = "{top: {where: {box: {z: [0.0065, 1]}}}}"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a round rod along x, an open one, and a box of its size."""
    rod = trimesh.creation.cylinder(RADIUS, LENGTH, sections=64)
    rod.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    rod.export(tmp_path / "rod.stl")
    trimesh.Trimesh(rod.vertices, rod.faces[1:]).export(tmp_path / "open.stl")
    trimesh.creation.box((LENGTH, 2 * RADIUS, 2 * RADIUS)).export(tmp_path / "box.stl")
    return tmp_path


def load(
    folder: Path,
    skin: str = "skin: {file: rod.stl}",
    *,
    cells: str = "cut",
    cell: float = RADIUS / 3.0,
    handles: str = HELD,
    more: str = "",
    **options: object,
) -> Scene:
    """Load the rod above its floor."""
    (folder / "rod.yaml").write_text(ROD.format(cell=cell, cells=cells, skin=skin, handles=handles, more=more))
    return load_scene(folder / "rod.yaml", **options)


def press(simulation: Simulation, depth: float, *, aside: float = 0.0):
    """Move the rod's top down and sideways [m]; return the converged step."""
    return advance(simulation, Command(handles={"top": Pose((0.0, aside, -depth))}))


def test_a_cut_rod_rolls_and_a_staircase_does_not(folder: Path) -> None:
    """On a slope, a skin rolls 70 to 105 % of a round rod's distance, and a staircase of cells stays."""
    ways = {}
    for name, skin, cells in (("skin", "skin: {file: rod.stl}", "cut"), ("faces", "", "whole")):
        simulation = Simulation(load(folder, skin, cells=cells, cell=RADIUS / 4.0, handles="{}", more=ROLLS))
        middle = simulation.mesh.vertices[:, 1].mean()
        for _ in range(25):
            assert simulation.step().converged
        ways[name] = simulation.positions[:, 1].mean() - middle
    rolled = 0.5 * (2.0 / 3.0) * 9.81 * np.sin(SLOPE) * 0.25**2
    assert 0.7 < ways["skin"] / rolled < 1.05
    assert abs(ways["faces"]) < 0.05 * rolled


def test_a_rod_rests_at_its_radius(folder: Path) -> None:
    """A cut rod above the floor has no contact at a gap of 0.2 % of its radius, and has contact at a depth of 1 %."""
    simulation = Simulation(load(folder))
    for depth, touches in ((-0.002, False), (0.01, True)):
        pushed = press(simulation, 0.00005 + depth * RADIUS).contacts["floor"].presses
        assert (len(pushed) > 0) == touches


def test_wrenches_sensors_and_points_are_one(folder: Path) -> None:
    """For a pressed and dragged rod, the forces of handle, obstacle, points and two sensors agree."""
    halves = {"left": {"box": {"x": [-1, 0]}}, "right": {"box": {"x": [1e-9, 1]}}}
    overrides = {"sensors": {name: {"where": where} for name, where in halves.items()}, "solver.tolerance": 1e-8}
    scene = load(folder, overrides=overrides)
    simulation = Simulation(scene)
    press(simulation, 0.0008)
    result = press(simulation, 0.0008, aside=0.0004)
    wrench, touch = result.reactions["floor"], result.contacts["floor"]
    assert wrench[2] > 0.1
    assert wrench[1] < -0.01
    np.testing.assert_allclose(result.reactions["top"][:3], -wrench[:3], atol=1e-6)
    points = contact_points(result.contacts)
    assert (points["vertex"] >= 0).all()
    felt = touch.forces.sum(axis=0)
    arms = touch.places - [0.0, 0.0, -0.01005]
    np.testing.assert_allclose(wrench, np.concatenate([felt, np.cross(arms, touch.forces).sum(axis=0)]), atol=1e-9)
    sensors = [scene.sensors[name].wrench(result)[:3] for name in halves]
    np.testing.assert_allclose(sum(sensors), wrench[:3], atol=1e-9)
    assert all(sensor[2] > 0.3 * wrench[2] for sensor in sensors)
    assert (np.linalg.norm(touch.shears, axis=1) <= 0.6 * touch.presses * (1.0 + 1e-6)).all()


def test_faces_sides_and_lost_sensors(folder: Path) -> None:
    """A sensor at a face of the skin is found; one without points, and one by vertices, is refused."""
    scene = load(folder, overrides={"sensors": {"end": {"where": {"face": "x+"}}}})
    centre = scene.sensors["end"].centre(scene.mesh.vertices)
    np.testing.assert_allclose(centre, [0.5 * LENGTH, 0.0, 0.0], atol=0.1 * RADIUS)
    for where, expected in (
        ({"sphere": {"center": [0, 0, 0], "radius": 0.001}}, "no point of the skin is there.*half a cell"),
        ({"vertices": [1, 2]}, "not of a skin; allowed: face, box, sphere"),
    ):
        with pytest.raises(SceneError, match=rf"sensors\.end\.where[\s\S]*{expected}"):
            load(folder, overrides={"sensors": {"end": {"where": where}}})


def test_what_a_handle_holds_touches_nothing(folder: Path) -> None:
    """The half of the rod that a handle holds has no contact with the floor; the other half has."""
    scene = load(folder, handles="{low: {where: {box: {z: [-1, 0]}}}}")
    simulation = Simulation(scene, terms=())
    assert simulation.step(Command(handles={"floor": Pose((0.0, 0.0, 0.001))})).contacts["floor"].presses.size == 0
    result = Simulation(load(folder)).step(Command(handles={"floor": Pose((0.0, 0.0, 0.001))}))
    assert result.contacts["floor"].presses.sum() > 0.1


def test_a_bag_a_checkpoint_and_the_file_give_the_same_bits(folder: Path) -> None:
    """A rolling rod from its own text, and from a checkpoint, has the same positions to the bit."""
    scene = load(folder, handles="{}", more=ROLLS)
    (folder / "rod.stl").unlink()
    first, again = Simulation(scene), Simulation(scene_from_text(scene.source))
    for _ in range(3):
        np.testing.assert_array_equal(first.step().positions, again.step().positions)
    third = Simulation(scene)
    load_state(third, save_state(first))
    assert first.result.contacts["floor"].presses.size
    for _ in range(2):
        np.testing.assert_array_equal(first.step().positions, third.step().positions)


def test_rigid_bodies_lie_on_the_skin(folder: Path) -> None:
    """A box that overlaps the rod's corner cells is accepted, and rests on the skin with its weight."""
    box = {"size": [0.02, 0.03, 0.004]}
    more = {"bodies": {"lid": {"box": box, "density": 2000, "at": [0, 0, 0.01205], "friction": 0.5}}}
    more |= {
        "obstacles": None,
        "loads": {"weight": {"gravity": [0, 0, -9.81]}},
        "dynamics": {"scheme": "bdf2", "step": 0.01},
    }
    more["dynamics"]["damping"] = {"mass": 20.0}
    scene = load(folder, handles="{low: {where: {box: {z: [-1, -0.0065]}}}}", overrides=more)
    simulation = Simulation(scene)
    result = advance(simulation, count=40)
    weight = 2000 * 0.02 * 0.03 * 0.004 * 9.81
    assert result.contacts["lid"].forces.sum(axis=0)[2] == pytest.approx(-weight, rel=0.02)
    assert abs(simulation.handle_pose("lid").translation[2]) < 0.05 * RADIUS


MESHES = """
name: two
meshes:
  rod:
    voxels: {surface: rod.stl, cell: 0.004, cells: cut}
    skin: {file: rod.stl}
    at: [0, 0.03, 0]
    rotation_deg: [0, 0, 90]
  bar: {bar: {size: [0.03, 0.02, 0.02], cells: [3, 2, 2]}, at: [0, -0.03, 0]}
materials: {soft: {law: neo_hookean, young: 5.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles:
  rod: {where: {mesh: rod, box: {z: [0.0065, 1]}}}
  bar: {where: {mesh: bar, face: z+}}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.01], friction: 0.6}}
solver: {tolerance: 1.0e-7}
sensors:
  rod: {where: {mesh: rod}}
  bar: {where: {mesh: bar, face: z-}}
  all: {where: {box: {z: [-1, 0]}}}
"""


def test_of_several_meshes_each_touches_by_what_it_has(folder: Path) -> None:
    """A rod with a skin and a bar without one each have their own sensor's force, and a common sensor the sum."""
    (folder / "two.yaml").write_text(MESHES)
    scene = load_scene(folder / "two.yaml")
    down = Pose((0.0, 0.0, -0.0005))
    result = advance(Simulation(scene), Command(handles={"rod": down, "bar": down}))
    felt = {name: sensor.wrench(result)[2] for name, sensor in scene.sensors.items()}
    assert min(felt.values()) > 0.05
    assert felt["rod"] == pytest.approx(-result.reactions["rod"][2], abs=1e-3)
    assert felt["bar"] == pytest.approx(-result.reactions["bar"][2], abs=1e-3)
    assert felt["all"] == pytest.approx(result.reactions["floor"][2], rel=1e-9)
    touch = result.contacts["floor"]
    assert set(touch.vertices[touch.points < 0]) <= set(scene.sensors["bar"].vertices)


RODS = """
name: rods
meshes:
  low: {{voxels: {{surface: rod.stl, cell: 0.004, cells: cut}}, skin: {{file: rod.stl}}}}
  high: {{voxels: {{surface: rod.stl, cell: 0.004, cells: cut}}, skin: {{file: rod.stl}}, at: [0, 0, {height}]}}
  bar: {{bar: {{size: [0.03, 0.02, 0.02], cells: [3, 2, 2]}}, at: [-0.015, 0, 0.041]}}
materials: {{soft: {{law: neo_hookean, young: 5.0e5, poisson: 0.4, density: 1000}}}}
regions: [{{material: soft}}]
handles: {{low: {{where: {{mesh: low}}}}, high: {{where: {{mesh: high}}}}, bar: {{where: {{mesh: bar, face: z+}}}}}}
self_contact: {where}
"""


@pytest.mark.parametrize(
    ("where", "quads", "skins"),
    [
        ("{}", 32, {"low", "high"}),
        ("{where: {mesh: low}}", 0, {"low"}),
        ("{where: {mesh: high, box: {z: [-1, 0]}}}", 0, {"high"}),
        ("{where: {mesh: bar, face: z-}}", 6, set()),
        ("{where: {box: {z: [0.0, 0.032]}}}", 6, {"low", "high"}),
    ],
)
def test_a_place_selects_skins_and_faces_that_touch(folder: Path, where: str, quads: int, skins: set[str]) -> None:
    """The key `where` of self-contact selects triangles of skins, and faces of the meshes without a skin."""
    (folder / "rods.yaml").write_text(RODS.format(height=0.0202, where=where))
    scene = load_scene(folder / "rods.yaml")
    assert len(scene.self_contact.quads) == quads
    corners = scene.mesh.touching.corners[np.unique(scene.self_contact.triangles)]
    parts = {
        name
        for name, part in scene.mesh.parts.items()
        if ((corners >= part.first_vertex) & (corners < part.first_vertex + part.mesh.n_vertices)).any()
    }
    assert parts == skins


@pytest.mark.parametrize(
    ("height", "where", "expected"),
    [
        (
            0.0185,
            "{}",
            r"meshes\.high\.at.*mesh 'high' lies in mesh 'low' initially, 0\.001\d* m deep or more.*remedy: move",
        ),
        (0.0202, "{where: {vertices: [0, 1]}}", r"self_contact\.where.*not of a skin; allowed: face, box, sphere"),
        (0.0202, "{where: {box: {z: [5, 6]}}}", r"self_contact\.where.*no boundary face is there"),
    ],
)
def test_skins_that_cannot_touch_are_refused(folder: Path, height: float, where: str, expected: str) -> None:
    """Skins in each other, and places that select no skin, are refused with the depth or the allowed selections."""
    (folder / "rods.yaml").write_text(RODS.format(height=height, where=where))
    with pytest.raises(SceneError, match=f"(?s:.*){expected}"):
        load_scene(folder / "rods.yaml")


def test_the_mesh_without_a_skin_is_named(folder: Path) -> None:
    """Of a rod with a skin and a cut rod without one, above a floor, the second is reported, in either order."""
    bare = "  bare: {voxels: {surface: rod.stl, cell: 0.004, cells: cut}, at: [0, -0.1, 0]}\n"
    for place in ("  bar: ", "  rod:\n"):
        (folder / "bare.yaml").write_text(MESHES.replace(place, bare + place, 1))
        with pytest.raises(
            SceneError, match=r"meshes\.bare\.voxels\.cells .*floor would act on the faces of cut cells"
        ):
            load_scene(folder / "bare.yaml")


@pytest.mark.parametrize(
    ("skin", "cells", "more", "expected"),
    [
        ("skin: {contact: true}", "cut", "", r"skin .*give exactly one of file, embedded"),
        ("skin: {file: open.stl, contact: true}", "cut", "", r"skin\.file.*contact needs a closed skin\. At 3 edges"),
        ("skin: {file: open.stl}", "cut", "", r"floor would act on the faces of cut.*remedy: `skin: .*closed surface"),
        ("", "cut", "", r"floor would act on the faces of cut.*remedy: `skin: .*closed surface"),
        ("skin: {file: rod.stl, contact: false}", "cut", "", r"floor would act on the faces of cut"),
        ("", "cut", "self_contact: {}", r"floor, self_contact would act on the faces of cut.*remedy: `skin: .*closed"),
    ],
)
def test_bad_input_is_refused(folder: Path, skin: str, cells: str, more: str, expected: str) -> None:
    """Contact or self-contact with a missing or open skin is refused with its key and remedy."""
    with pytest.raises(SceneError, match=f"(?s:.*){expected}"):
        load(folder, skin, cells=cells, cell=RADIUS / 6.0, more=more)


def test_a_skin_with_a_defect_is_told_once(folder: Path) -> None:
    """A missing skin file for cut cells above a floor is one defect; the missing skin is not reported again."""
    with pytest.raises(SceneError) as caught:
        load(folder, "skin: {file: nowhere.stl}")
    assert len(caught.value.defects) == 1
    assert "nowhere.stl" in caught.value.defects[0]


def test_a_defect_of_a_probe_called_skin_hides_no_other(folder: Path) -> None:
    """A probe named skin with a defect is reported, in addition to the defect that the cut cells have no skin."""
    with pytest.raises(SceneError) as caught:
        load(folder, "", more="probes: {skin: {at: [9, 9, 9]}}")
    told = "\n".join(caught.value.defects)
    assert "floor would act on the faces of cut cells" in told
    assert "probes.skin" in told


def test_an_open_skin_is_still_shown_where_nothing_touches(folder: Path) -> None:
    """An open skin on cut cells without obstacles, and a skin on whole cells, are drawn but have no contact."""
    scene = load(folder, "skin: {file: open.stl}", overrides={"obstacles": None})
    assert (scene.mesh.skin is not None, scene.mesh.touching) == (True, None)
    scene = load(folder, cells="whole", cell=RADIUS / 6.0)
    assert (scene.mesh.skin is not None, scene.mesh.touching) == (True, None)
