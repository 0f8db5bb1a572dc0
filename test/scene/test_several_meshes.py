# SPDX-License-Identifier: Apache-2.0
"""The key `meshes` of a scene: several soft bodies by name, each with its pose, and positions in their frames."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh

from gdfe_ros import Command, Simulation
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import SceneError
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.scene import load_scene, scene_from_text
from gdfe_ros.scene.document import parse_document
from gdfe_ros.scene.solvable import remarks
from gdfe_ros.solver.settings import Policy
from test.written import advance

BAR = "bar: {size: [0.04, 0.01, 0.01], cells: [4, 1, 1]}"
PAIR = f"""
name: pair
meshes:
  left: {{{BAR}, at: [0, 0.01, 0], rotation_deg: [0, 0, 90]}}
  right: {{{BAR}, at: [0.1, 0, 0]}}
materials: {{soft: {{law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}, hard: {{law: linear, young: 1.0e6,
  poisson: 0.4, density: 1000}}}}
regions: [{{material: soft}}, {{material: hard, where: {{mesh: left, box: {{x: [0.03, 0.04]}}}}}}]
handles:
  left: {{where: {{mesh: left, face: x-}}}}
  right: {{where: {{mesh: right, face: x-}}, fixed: true}}
"""


def broken(text: str) -> str:
    """Return all defects of a text."""
    with pytest.raises(SceneError) as caught:
        scene_from_text(text)
    return "\n".join(caught.value.defects)


def test_several_meshes_under_the_key_mesh_are_named() -> None:
    """Named meshes under `mesh` are refused with the right key; a misspelt kind of mesh is still called unknown."""
    assert "mesh (line 3): lists several meshes: left, right; remedy: rename" in broken(
        PAIR.replace("meshes:", "mesh:")
    )
    assert "mesh.barr" in broken(PAIR.replace("meshes:", "mesh: {barr: {size: [1, 1, 1]}}\nold:"))


def test_every_place_may_be_told_in_the_frame_of_a_mesh() -> None:
    """Positions in the frame of a named mesh work in every section of a scene."""
    scene = scene_from_text(
        PAIR
        + """
probes: {tip: {mesh: left, at: [0.04, 0, 0]}, same: [0, 0.05, 0], other: {mesh: right, at: [0.04, 0, 0.005]}}
sensors: {pad: {where: {mesh: left, face: z+}}, all: {where: {mesh: right}}}
masses: {payload: {mass: 0.1, where: {mesh: right, vertices: [0, 1]}}, camera: {mass: 0.1, probe: other}}
actuators:
  tendon: {cable: {mesh: left, points: [[0, 0, 0.005], [0.04, 0, 0.005]]}}
  muscle: {growth: {stretch: [0.9, 1.0, 1.2], where: {mesh: left, face: x+}}}
loads: {push: {point: {mesh: left, at: [0.04, 0, 0], force: [1, 0, 0]}}}
self_contact: {where: {mesh: right}}
"""
    )
    rest, points = scene.mesh.vertices, {name: probe.at(scene.mesh.vertices)[0] for name, probe in scene.probes.items()}
    assert scene.cell_material.tolist() == [0, 0, 0, 1, 0, 0, 0, 0]
    np.testing.assert_allclose(rest[scene.handles[0].vertices, 1], 0.01, atol=1e-15)
    np.testing.assert_allclose(rest[scene.handles[1].vertices, 0], 0.1)
    np.testing.assert_allclose(points["tip"], [0, 0.05, 0], atol=1e-15)
    np.testing.assert_allclose(points["tip"], points["same"], atol=1e-15)
    np.testing.assert_allclose(points["other"], [0.14, 0, 0.005], atol=1e-15)
    assert set(scene.sensors["pad"].vertices) == set(np.flatnonzero((rest[:, 2] > 0) & (rest[:, 0] < 0.05)))
    assert set(scene.sensors["all"].vertices) == set(np.flatnonzero(rest[:, 0] > 0.05))
    assert scene.masses[0].points.corners.ravel().tolist() == [20, 21]
    tendon, muscle = scene.actuators
    np.testing.assert_allclose(tendon.points.at(rest), [[0, 0.01, 0.005], [0, 0.05, 0.005]], atol=1e-15)
    np.testing.assert_allclose(muscle.stretch, np.diag([1.0, 0.9, 1.2]), atol=1e-15)
    assert muscle.cells.tolist() == [3]
    np.testing.assert_allclose(scene.loads[0].point.at(rest), [[0, 0.05, 0]], atol=1e-15)
    assert set(np.unique(scene.self_contact.quads)) == set(scene.sensors["all"].vertices)


def test_a_chamber_is_that_of_its_mesh() -> None:
    """Each of two closed tubes has one cavity of its own, and the scene has two."""
    tube = "tube: {inner: 0.004, outer: 0.006, length: 0.03, cells: [1, 8, 3], cap: 0.002}"
    text = PAIR.replace(BAR, tube).replace("0.03, 0.04", "0.02, 0.04")
    chambers = "actuators: {one: {chamber: {mesh: right}}, two: {chamber: {mesh: left, near: [0.01, 0, 0]}}}"
    scene = scene_from_text(text + chambers)
    one, two = (actuator.quads for actuator in scene.actuators)
    np.testing.assert_allclose(scene.mesh.vertices[two].mean(axis=(0, 1)), [0, 0.025, 0], atol=1e-12)
    np.testing.assert_allclose(scene.mesh.vertices[one].mean(axis=(0, 1)), [0.115, 0, 0], atol=1e-12)
    assert "the body has 2 cavities" in broken(text + "actuators: {one: {chamber: {}}}")
    twice = "actuators: {one: {chamber: {mesh: left, where: {face: x+}}}}"
    assert "write it inside: where: {mesh: left, ...}" in broken(text + twice)
    assert "mesh 'left' has no closed cavity" in broken(PAIR + "actuators: {one: {chamber: {mesh: left}}}")


@pytest.mark.parametrize("apart", [0.05, 3.0])
def test_fingers_move_as_one_alone_however_far_they_are_apart(apart: float) -> None:
    """Each of two fingers in a scene curls as one alone, within three tolerances relative to a finger's size."""
    plain = {"loads": None, "program": None}
    alone = Simulation(load_scene("tendon_finger", overrides=plain))
    data = parse_document(alone.scene.path.read_text(), heading="scene").data
    names, flexor = {"left": 0.0, "right": apart}, data["actuators"]["flexor"]["cable"]
    overrides = plain | {
        "mesh": None,
        "meshes": {name: {**data["mesh"], "at": [0, y, 0]} for name, y in names.items()},
        "handles": {name: {"where": {"mesh": name, "face": "x-"}, "fixed": True} for name in names},
        "actuators": {name: {"cable": {**flexor, "mesh": name}} for name in names},
        "probes": {name: {"mesh": name, "at": data["probes"]["tip"]} for name in names},
    }
    pair = Simulation(load_scene("tendon_finger", overrides=overrides))
    assert pair.mesh.size == alone.mesh.size
    for tension in (1.0, 3.0, 6.0):
        one = alone.step(Command(actuators={"flexor": tension}))
        both = advance(pair, Command(actuators=dict.fromkeys(names, tension)))
        for found, y in zip(np.split(both.positions, 2), names.values(), strict=True):
            assert np.abs(found - [0, y, 0] - one.positions).max() < 3e-4 * alone.mesh.size


def test_meshes_push_each_other() -> None:
    """Two bars pressed on each other have opposite forces, between vertices of both."""
    text = PAIR.replace("[0.1, 0, 0]", "[0.006, 0.03, 0]") + "self_contact: {friction: 0.3}\nsolver: {tolerance: 1e-5}"
    simulation = Simulation(scene_from_text(text))
    result = advance(simulation, Command(handles={"left": Pose((0.003, 0.0, 0.0))}))
    touch = result.contacts["(self)"]
    assert {bool(vertex < 20) for vertex in touch.vertices} == {True, False}
    np.testing.assert_allclose(touch.forces.sum(axis=0), 0.0, atol=1e-9)
    assert result.reactions["left"][0] == pytest.approx(-result.reactions["right"][0], rel=1e-3)
    assert result.reactions["left"][0] > 0.1


def test_meshes_that_pass_through_each_other_are_remarked() -> None:
    """Meshes without contact between them give a remark, and with self-contact none."""
    assert "self_contact: {friction: 0.5}" in " ".join(Simulation(scene_from_text(PAIR)).remarks())
    assert not Simulation(scene_from_text(PAIR + "self_contact: {}")).remarks()


def test_what_came_from_files_is_carried_in_place(tmp_path: Path) -> None:
    """A mesh, voxels and a skin from files are rebuilt from the scene's text as the same bodies."""
    mesh, rod = bar([0.04, 0.01, 0.01], [4, 1, 1]), trimesh.creation.box((0.04, 0.01, 0.01))
    meshio.Mesh(mesh.vertices, [("hexahedron", mesh.cells)]).write(tmp_path / "bar.vtk", binary=False)
    rod.apply_translation([0.02, 0, 0]).export(tmp_path / "rod.stl")
    text = PAIR.replace(BAR, "file: bar.vtk, skin: {file: rod.stl}", 1)
    text = text.replace(BAR, "voxels: {surface: rod.stl, cell: 0.005}, skin: {file: rod.stl}")
    (tmp_path / "scene.yaml").write_text(text)
    scene = load_scene(tmp_path / "scene.yaml")
    again = scene_from_text(scene.source)
    for name in ("vertices", "cells"):
        np.testing.assert_array_equal(getattr(again.mesh, name), getattr(scene.mesh, name))
    np.testing.assert_array_equal(again.mesh.skin.weights, scene.mesh.skin.weights)
    shown = scene.mesh.outside.at(scene.mesh.vertices)
    np.testing.assert_allclose([shown.min(axis=0), shown.max(axis=0)], scene.mesh.bounds, atol=1e-7)
    assert scene.source.count("embedded") == 4
    assert "file" not in scene.source


def test_overrides_reach_into_a_mesh() -> None:
    """Overrides move one mesh and refine another, as in a sweep, and bags contain the changes."""
    scene = scene_from_text(PAIR, overrides={"meshes.right.at": [0.2, 0, 0], "meshes.left.bar.cells": [8, 1, 1]})
    assert (scene.mesh.n_cells, scene.mesh.bounds[1, 0]) == (12, pytest.approx(0.24))
    assert scene_from_text(scene.source).mesh.n_cells == 12


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("mesh: left, face", "mesh: lft, face", r"handles.left.where.mesh = 'lft' \(line 10\).*did you mean 'left'"),
        ("at: [0.1, 0, 0]", "at: [0.0, 0.02, 0]", r"meshes.right.at = .*'right' lies in mesh 'left'.*move or turn one"),
        ("at: [0.1, 0, 0]", "at: [0.1, 0]", r"meshes.right.at = \[0.1, 0\] \(line 5\).*3 numbers"),
        ("cells: [4, 1, 1]", "cells: [4, 0, 1]", r"meshes.left.bar.cells = \[4, 0, 1\]"),
        ("{bar: {size: [0.04, 0.01, 0.01], cells: [4, 1, 1]}, at: [0.1, 0, 0]}", "{at: [0, 0, 0]}",
         r"meshes.right.*exactly one of bar.*given: none"),
        ("{bar: {size: [0.04, 0.01, 0.01], cells: [4, 1, 1]}, at: [0.1, 0, 0]}", "", r"meshes.right.*mapping"),
        ("right:", "2nd:", r"meshes.2nd.*allowed names"),
        ("  right: {where: {mesh: right, face: x-}, fixed: true}", "  more: {where: {mesh: left, face: x+}}",
         r"no handle holds mesh 'right' along x; remedy: add a handle there.*or `dynamics: {}`"),
        ("mesh: left, box: {x: [0.03, 0.04]}", "mesh: left, box: {y: [0.03, 0.04]}",
         r"regions.1.where.*no cell is there; mesh 'left' in its own frame spans x 0 to 0.04"),
        ("meshes:", "mesh: {bar: {size: [1, 1, 1], cells: [1, 1, 1]}}\nmeshes:", r"meshes.*`mesh` is there, too"),
        ("materials:", "skin: {file: x.stl}\nmaterials:", r"skin.*put it into its mesh"),
        ("materials:", "probes: {tip: {mesh: lef, at: [0, 0, 0]}}\nmaterials:", r"probes.tip.mesh = 'lef'.*'left'"),
        ("materials:", "probes: {tip: {mesh: left}}\nmaterials:", r"probes.tip.at.*is missing"),
        ("materials:", "probes: {tip: {mesh: left, at: [0, 1, 0]}}\nmaterials:",
         r"probes.tip.*lies outside of the body.*in the frame of mesh 'left'"),
        ("materials:", "actuators: {a: {cable: {mesh: up, points: [[0, 0, 0], [0.01, 0, 0]]}}}\nmaterials:",
         r"actuators.a.cable.mesh = 'up'.*allowed: left, right"),
        ("materials:", "loads: {a: {point: {mesh: up, at: [0, 0, 0], force: [0, 0, 0]}}}\nmaterials:",
         r"loads.a.point.mesh = 'up'"),
    ],
)  # fmt: skip
def test_defects_are_named(old: str, new: str, said: str) -> None:
    """A defect is reported with file, key, value and remedy."""
    assert old in PAIR
    found = broken(PAIR.replace(old, new, 1))
    assert re.search(said, found), found


def test_scenes_without_a_body_and_names_without_meshes(sound: str) -> None:
    """A scene without a body, with empty meshes, or with a mesh name in a single mesh is refused."""
    assert "mesh (line 1): is missing; needed: the body" in broken("name: x\n")
    assert "mesh (line 2): is empty; needed" in broken("name: x\nmesh:\n")
    assert "there is no mesh; give e.g. {left:" in broken("name: x\nmeshes: {}\n")
    assert "the one `mesh` of this scene has no name" in broken(sound.replace("{face: x-}", "{mesh: left, face: x-}"))
    assert "(line 3)" in broken("name: x\nmeshes:\n  left:\n")


def test_a_mesh_with_defects_hides_no_others() -> None:
    """A bad mesh and a bad material are both reported at once."""
    text = PAIR.replace("cells: [4, 1, 1]", "cells: [4, 1, 1], cut: [{cells: [0, 1, 2, 3]}]", 1)
    found = broken(text.replace("young: 1.0e6", "young: -1"))
    assert "meshes.left.bar" in found
    assert "materials.hard.young" in found
    assert isinstance(scene_from_text(PAIR).mesh, HexMesh)


@pytest.mark.parametrize("cells", ["cut", "whole"])
@pytest.mark.parametrize("skin", ["", ", skin: {file: ball.stl, contact: true}"])
def test_the_remedy_for_meshes_that_do_not_touch_is_none_that_is_refused(tmp_path: Path, skin: str, cells: str) -> None:
    """The remedy named in the remark on meshes without contact works for whole and cut cells, with and without skin."""
    trimesh.creation.icosphere(subdivisions=3, radius=0.02).export(tmp_path / "ball.stl")
    path = tmp_path / "ball.yaml"
    ball = f"  ball: {{voxels: {{surface: ball.stl, cell: 0.008, cells: {cells}}}{skin}, at: [0, 0, 0.1]}}"
    path.write_text(PAIR.replace("meshes:", f"meshes:\n{ball}") + "dynamics: {}\n")
    (remark,) = [text for text in remarks(load_scene(path), Policy.ENERGY) if "pass through each other" in text]
    overrides: dict[str, object] = {"self_contact": {"friction": 0.5}}
    if "skin: {file: ...}" in remark:
        overrides["meshes.ball.skin"] = {"file": str(tmp_path / "ball.stl")}
    scene = load_scene(path, overrides=overrides)
    assert not [text for text in remarks(scene, Policy.ENERGY) if "pass through each other" in text]
