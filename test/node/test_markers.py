# SPDX-License-Identifier: Apache-2.0
"""Markers: the packed bytes equal the message made by rclpy."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from gdfe_ros.colour_map import colour
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh.files.stored_mesh import pack_surface
from gdfe_ros.mesh.generators import bar
from gdfe_ros.mesh.outside import carry_skin
from gdfe_ros.node.messages import MOST_TRIANGLES, ContactMarkers, SurfaceMarker, pose_stamped
from gdfe_ros.results.contacts import POINT
from gdfe_ros.scene.loader import scene_from_text

CUBE = """
name: cube
mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [4, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4}}
regions: [{material: soft}]
handles: {top: {where: {face: z+}, fixed: true}}
obstacles:
  rod: {capsule: {radius: 0.04, length: 0.04}, at: [0.05, 0, -0.1], rotation_deg: [0, 90, 0]}
  wall: {plane: [-1, 0, 0], at: [0.2, 0.3, 0], fixed: true}
"""
MESH = bar((0.3, 0.1, 0.1), (3, 1, 1))


def test_the_surface_is_closed_and_looks_outwards() -> None:
    """A marker has 28 triangles that enclose the bar's volume, and the right stamp and frame."""
    data = SurfaceMarker(MESH, "robot/base_link").pack(12_250_000_000, MESH.vertices, np.arange(3.0))
    marker = deserialize_message(data, Marker)
    assert (marker.header.frame_id, marker.header.stamp.sec, marker.header.stamp.nanosec) == (
        "robot/base_link",
        12,
        250_000_000,
    )
    triangles = np.array([[point.x, point.y, point.z] for point in marker.points]).reshape(-1, 3, 3)
    assert len(triangles) == 2 * (2 + 4 * 3)
    assert np.linalg.det(triangles).sum() / 6 == pytest.approx(0.3 * 0.1 * 0.1)
    assert len(marker.colors) == len(marker.points)
    assert len(serialize_message(marker)) == len(data)


def test_each_cell_has_its_colour() -> None:
    """For rising values, the first cell is viridis' violet, and the last its yellow."""
    data = SurfaceMarker(MESH, "base_link").pack(0, MESH.vertices, np.array([1.0, 2.0, 3.0]))
    marker = deserialize_message(data, Marker)
    for point, found in zip(marker.points, marker.colors, strict=True):
        if point.x == 0.0:
            assert (found.r, found.g, found.b) == pytest.approx((0.267, 0.005, 0.329), abs=1e-6)
        if point.x == pytest.approx(0.3):
            assert (found.r, found.g, found.b) == pytest.approx((0.993, 0.906, 0.144), abs=1e-6)
        assert found.a == 1.0


def test_equal_values_have_one_colour() -> None:
    """A constant field has one colour, without a division by zero."""
    assert (colour(np.full(4, 7.0)) == colour(np.zeros(4))).all()


def test_markers_are_throttled(client: Any, start: Callable, coarse: dict) -> None:
    """With many steps, markers are published at `marker_rate`, coloured by the chosen field."""
    markers: list[Marker] = []
    start(**coarse, clock="lockstep", marker_rate=2.0, marker_field="J")
    client.node.create_subscription(Marker, client.full("markers"), markers.append, 10)
    begin = time.monotonic()
    client.target(0.001)
    for step in itertools.count(2):
        client.wait_steps(step)
        if step > 50 and len(markers) >= 3:
            break
        client.target(1e-4 * (step % 100))
    assert len(markers) <= 2.0 * (time.monotonic() - begin) + 2
    assert len(markers[-1].points) == 6 * (4 * 2 * 20 + 2 * 4)
    assert client.set(marker_field="strength")[0].reason.startswith("parameter marker_field is 'strength'; allowed")


def test_a_changed_marker_rate_acts_at_once(client: Any, start: Callable, coarse: dict) -> None:
    """After a marker at 0.01 Hz, the steps at 100 Hz have one each."""
    start(**coarse, clock="lockstep", marker_rate=0.01)
    markers = client.listen("markers", Marker)
    client.wait(lambda: markers)
    client.target(0.001)
    client.wait_steps(2)
    count = len(markers)
    assert client.set(marker_rate=100.0)[0].successful
    client.target(0.002)
    client.wait(lambda: len(markers) > count, seconds=60.0)


def test_obstacles_and_forces_are_shown(client: Any, start: Callable, tmp_path: Path) -> None:
    """With a capsule pressed into a cube beside a wall, markers are at the obstacles, and arrows show the force."""
    path, arrays = tmp_path / "cube.yaml", []
    path.write_text(CUBE)
    client.node.create_subscription(MarkerArray, client.full("contact_markers"), arrays.append, 10)
    start(scene=str(path), clock="lockstep", marker_rate=100.0)
    client.publish("obstacles/rod/target", pose_stamped(Header(), Pose((0.0, 0.0, 0.015))))
    client.wait(lambda: arrays and arrays[-1].markers[-1].ns == "forces")
    first, *markers = arrays[-1].markers
    assert first.action == Marker.DELETEALL
    assert len({(marker.ns, marker.id) for marker in markers}) == len(markers)
    rod = [marker for marker in markers if marker.ns == "obstacles"][:3]
    assert [marker.type for marker in rod] == [Marker.CYLINDER, Marker.SPHERE, Marker.SPHERE]
    places = np.array([_place(marker.pose.position) for marker in rod])
    # The rod lies along x: its ends are half its length from its middle.
    np.testing.assert_allclose(places, np.add([0.05, 0.0, -0.085], [[0, 0, 0], [-0.02, 0, 0], [0.02, 0, 0]]), atol=1e-9)
    assert (rod[0].scale.x, rod[0].scale.z, rod[1].scale.y) == (0.08, 0.04, 0.08)
    wall = markers[3]
    assert (wall.type, wall.scale.z) == (Marker.CUBE, pytest.approx(0.005 * 0.1 * np.sqrt(3.0)))
    # Its outer side is the plane x = 0.2, beside the cube's middle.
    np.testing.assert_allclose(_place(wall.pose.position), [0.2 + 0.5 * wall.scale.z, 0.0, 0.0], atol=1e-9)
    arrows = np.array([[_place(point) for point in marker.points] for marker in markers if marker.ns == "forces"])
    total = (arrows[:, 1] - arrows[:, 0]).sum(axis=0)
    assert total[2] > 0.99 * np.linalg.norm(total)
    assert np.linalg.norm(arrows[:, 1] - arrows[:, 0], axis=1).max() == pytest.approx(
        0.3 * 0.1 * np.sqrt(3.0), rel=1e-3
    )


@pytest.mark.parametrize("subdivisions", [2, 5])
def test_a_mesh_is_shown_as_its_triangles(subdivisions: int) -> None:
    """A triangle mesh is published in its frame: all triangles of a coarse one, a limited number of a fine one."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.02)
    entry = {"mesh": {"embedded": pack_surface(ball.vertices, ball.faces)}, "at": [0.05, 0.0, -0.1]}
    scene = scene_from_text(CUBE, overrides={"obstacles": {"part": entry}})
    poses = {"part": Pose((0.0, 0.0, 0.01))}
    _, marker = ContactMarkers(scene).message(Header(), poses, np.zeros(0, POINT)).markers
    assert (marker.ns, marker.type, marker.scale.x) == ("obstacles", Marker.TRIANGLE_LIST, 1.0)
    np.testing.assert_allclose(_place(marker.pose.position), [0.05, 0.0, -0.09])
    triangles = np.array([_place(point) for point in marker.points]).reshape(-1, 3, 3)
    assert len(triangles) == len(ball.faces) if subdivisions == 2 else 1000 < len(triangles) <= MOST_TRIANGLES
    assert np.linalg.det(triangles).sum() / 6 == pytest.approx(ball.volume, rel=0.02)


def _place(point: Any) -> list[float]:
    return [point.x, point.y, point.z]


def test_a_marker_shows_the_skin_of_a_mesh_that_has_one() -> None:
    """A marker of a mesh with a skin has the skin's triangle, moved with its cell."""
    points = np.array([[0.1, 0.1, 0.1], [0.9, 0.2, 0.3], [0.2, 0.8, 0.6]]) * MESH.size / 10.0 + MESH.bounds[0]
    skin = carry_skin(MESH.vertices, MESH.cells, points, np.array([[0, 1, 2]]))
    moved = 2.0 * MESH.vertices + 1.0
    data = SurfaceMarker(replace(MESH, skin=skin), "base_link").pack(0, moved, np.arange(float(MESH.n_cells)))
    marker = deserialize_message(data, Marker)
    found = sorted((point.x, point.y, point.z) for point in marker.points)
    np.testing.assert_allclose(found, sorted(map(tuple, 2.0 * points + 1.0)), atol=1e-9)
