# SPDX-License-Identifier: Apache-2.0
"""Collision shapes of links: meshes become convex pieces, which bear loads as boxes of the same size do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros import Simulation, load_scene
from gdfe_ros.errors import SceneError
from gdfe_ros.scene.loader import scene_from_text
from test.arms.conftest import SCENE, TWO_LINKS
from test.written import advance

_BOX = '<box size="0.05 0.05 0.3"/>'
_BODY = "dynamics: {step: 0.005}\nbodies: {part: {box: {size: [0.04, 0.02, 0.02]}, mass: 0.2, at: [-0.4, 0, 0.0352]}}\n"


def _with_mesh(folder: Path, mesh: trimesh.Trimesh, scale: str = "1 1 1") -> Path:
    """Write a scene in which a mesh replaces the box of the first link; return its path."""
    mesh.export(folder / "one.stl")
    text = TWO_LINKS.replace(_BOX, f'<mesh filename="one.stl" scale="{scale}"/>')
    (folder / "two.urdf").write_text(text, encoding="utf-8")
    path = folder / "mesh.yaml"
    path.write_text(SCENE.format(urdf="two.urdf") + _BODY, encoding="utf-8")
    return path


def test_each_piece_of_a_mesh_is_an_obstacle(two_links: Path) -> None:
    """Two separate cubes are two obstacles; a dented one is its convex hull; the scale of the URDF is used."""
    pieces = [trimesh.creation.box((40, 40, 60)).apply_translation((0, 0, z)) for z in (-80, 80)]
    dented = trimesh.creation.box((10, 10, 10)).subdivide()
    dented.vertices[np.argmax(dented.vertices @ [0.0, 0.1, 1.0] - np.abs(dented.vertices[:, 1]))] *= 0.1
    scene = load_scene(_with_mesh(two_links.parent, trimesh.util.concatenate([*pieces, dented]), "1e-3 1e-3 1e-3"))
    links = scene.arms[0].links
    assert [link.name for link in links] == ["one_piece", "one_piece_2", "one_piece_3"]
    volumes = sorted(link.form.volume for link in links)
    assert volumes == pytest.approx([1e-6, 9.6e-5, 9.6e-5], rel=1e-6)
    again = scene_from_text(scene.source)
    assert [link.form.volume for link in again.arms[0].links] == [link.form.volume for link in links]


def test_a_mesh_bears_a_body_as_a_box_does(two_links: Path) -> None:
    """A body lies on a link: its weight is on the arm, with equal efforts for a box and a mesh of its size."""
    folder = two_links.parent
    box = folder / "box.yaml"
    box.write_text(SCENE.format(urdf="two.urdf") + _BODY, encoding="utf-8")
    efforts = []
    for path, weight in ((box, 0.2), (box, 0.4), (None, 0.2)):
        path = path or _with_mesh(folder, trimesh.creation.box((0.05, 0.05, 0.3)))
        simulation = Simulation(load_scene(path, overrides={"bodies.part.mass": weight, "solver.tolerance": 1e-5}))
        advance(simulation, dt=0.005, count=60)
        assert abs(simulation.handle_pose("part").translation[2]) < 3e-4
        efforts.append(simulation.joint_states()["lift"].effort)
    assert efforts[1] - efforts[0] == pytest.approx(-0.2 * 9.81 * 0.2, rel=0.01)
    assert efforts[2] == pytest.approx(efforts[0], rel=1e-3)


def test_a_flat_mesh_is_named(two_links: Path) -> None:
    """A plate without thickness bounds no solid; the link, the file and the remedy are told."""
    flat = trimesh.Trimesh(vertices=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], faces=[[0, 1, 2], [0, 2, 3]])
    with pytest.raises(SceneError, match=r"link 'one', one.stl: it is flat, and bounds no solid.*remedy"):
        load_scene(_with_mesh(two_links.parent, flat))
