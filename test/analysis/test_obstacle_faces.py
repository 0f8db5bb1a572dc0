# SPDX-License-Identifier: Apache-2.0
"""Obstacles in pictures."""

from __future__ import annotations

from io import BytesIO

import matplotlib.image
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from gdfe_ros.analysis.picture import OBSTACLE, draw_body
from gdfe_ros.analysis.scenery import Scenery, faces_of, find_recorded_faces, obstacle_faces
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.form import Box, Capsule, Cylinder, Form, Plane, Sphere, TriangleMesh
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.mesh.surfaces.solid import make_solid
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from test.written import scene_of

CUBE = trimesh.creation.box((0.1, 0.2, 0.3))
ROD = 0.02**2 * np.pi * 0.1
FORMS = [
    (Sphere(0.02), 4.0 / 3.0 * np.pi * 0.02**3),
    (Box((0.1, 0.2, 0.3)), 0.006),
    (Capsule(0.02, 0.1), ROD + 4.0 / 3.0 * np.pi * 0.02**3),
    (Cylinder(0.02, 0.1), ROD),
    (TriangleMesh(make_solid(CUBE.vertices, CUBE.faces)), 0.006),
]
PLACE = {"origin": (1.0, 2.0, 3.0), "turn": (0.3, -0.2, 0.5)}
POSE = Pose((0.1, 0.2, -0.3), (0.4, 0.0, 0.1))


def test_faces_of_a_record_are_where_the_obstacle_was() -> None:
    """An obstacle with a recorded pose is drawn there, one without a record at its initial pose."""
    text = """
mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [2, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4}}
handles: {base: {where: {face: x-}}}
obstacles: {moved: {sphere: {radius: 0.02}, at: [0.3, 0, 0]}, still: {sphere: {radius: 0.02}, at: [0, 0.3, 0]}}
"""
    scene = scene_of(text)
    turn = Rotation.from_rotvec(POSE.rotation).as_quat()
    values = {f"pose.position.{axis}": np.array([POSE.translation[k]]) for k, axis in enumerate("xyz")}
    values |= {f"pose.orientation.{axis}": np.array([turn[k]]) for k, axis in enumerate("xyzw")}
    moved, still = find_recorded_faces(scene, {"obstacles/moved/pose": values}, scene.mesh.vertices)
    obstacle = {handle.name: handle for handle in scene.handles}
    np.testing.assert_allclose(moved, obstacle_faces(obstacle["moved"], POSE, scene.mesh.vertices), atol=1e-12)
    np.testing.assert_allclose(still, obstacle_faces(obstacle["still"], Pose(), scene.mesh.vertices), atol=1e-12)


@pytest.mark.parametrize(("form", "volume"), FORMS, ids=lambda item: type(item).__name__)
def test_faces_enclose_the_obstacle_where_it_is(form: Form, volume: float) -> None:
    """The faces point outward, enclose the volume within 3 %, and are centred at the obstacle's pose."""
    obstacle = Obstacle(name="thing", form=form, **PLACE)
    faces = obstacle_faces(obstacle, POSE, np.zeros((1, 3)))
    origin, _ = obstacle.frame(POSE)
    own = faces - origin
    found = sum(np.linalg.det(own[:, [0, i, i + 1]]).sum() / 6.0 for i in range(1, faces.shape[1] - 1))
    assert found == pytest.approx(volume, rel=0.03)
    np.testing.assert_allclose(0.5 * (own.reshape(-1, 3).min(axis=0) + own.reshape(-1, 3).max(axis=0)), 0.0, atol=1e-9)


def test_a_plane_lies_below_what_is_before_it() -> None:
    """A plane is drawn as one square in the plane that extends beyond the given points."""
    obstacle = Obstacle(name="floor", form=Plane(), origin=(0.0, 0.0, -1.0))
    faces = obstacle_faces(obstacle, Pose((0.0, 0.0, 0.5)), np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 0.0]]))
    assert faces.shape == (1, 4, 3)
    np.testing.assert_allclose(faces[0, :, 2], -0.5)
    np.testing.assert_allclose([faces[0].min(axis=0)[:2], faces[0].max(axis=0)[:2]], [[-0.5, -0.5], [2.5, 1.5]])


def test_pictures_show_the_obstacles_of_a_scene() -> None:
    """The picture of the shipped finger with its plate has thousands of pixels in the plate's colour."""
    simulation = Simulation(load_scene("finger_press"))
    mesh, picture = simulation.mesh, BytesIO()
    found = faces_of(simulation)
    scenery = Scenery(obstacles=found)
    draw_body(picture, mesh, mesh.vertices, np.zeros(mesh.n_cells), title="", label="", scenery=scenery)
    picture.seek(0)
    pixels = matplotlib.image.imread(picture)[:, :1150]
    assert [faces.shape for faces in found] == [(6, 4, 3)]
    assert OBSTACLE[0] > OBSTACLE[2]
    assert np.count_nonzero(pixels[..., 0] > pixels[..., 2] + 0.05) > 5000
