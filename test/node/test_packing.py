# SPDX-License-Identifier: Apache-2.0
"""The packed bytes equal the messages that rclpy makes of the same numbers."""

from __future__ import annotations

import array
import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Quaternion, Vector3, Wrench, WrenchStamped
from rclpy.serialization import deserialize_message
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, PointCloud2, PointField

from gdfe_ros.constraints import Pose
from gdfe_ros.node import messages
from gdfe_ros.recording.message_tables import (
    IMU,
    MESH,
    POSE,
    STRAIN,
    VELOCITY,
    WRENCH,
    write_imu,
    write_mesh,
    write_pose,
    write_strain,
)
from gdfe_ros.recording.packing import Packer
from gdfe_ros.results.inertial_units import ImuReading
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command, Simulation

FRAME = "robot/base_link"
HEAD = messages.header(12_250_000_000, FRAME)


@pytest.fixture(scope="module")
def bent() -> Simulation:
    """Return a small bent bar."""
    simulation = Simulation(load_scene("bend5", overrides={"mesh.bar.cells": [5, 2, 2]}))
    simulation.step(Command(handles={"tip": Pose((0.0, 0.0, 0.1), (0.0, -0.3, 0.0))}))
    return simulation


def _same(data: bytes, message: Any) -> bool:
    return deserialize_message(data, type(message)) == message


def _writer(write: Callable[..., None], *numbers: Any) -> Callable[[np.ndarray], None]:
    """Return the function that writes the numbers of a message into the rows of a packer."""
    return lambda rows: write(rows, *numbers)


_mesh = partial(_writer, write_mesh)
_strain = partial(_writer, write_strain)
_pose = partial(_writer, write_pose)
_imu = partial(_writer, write_imu)


def _numbers(*columns: np.ndarray) -> Callable[[np.ndarray], None]:
    """Return the function that writes columns of numbers into the rows of a packer."""
    return partial(np.copyto, src=np.hstack(columns))


def _cloud(names: str, *parts: np.ndarray) -> PointCloud2:
    """Return rclpy's message of a cloud whose columns are ``parts``."""
    values = np.hstack([part.reshape(len(part), -1) for part in parts]).astype("<f4")
    fields = [PointField(name=name, offset=4 * k, datatype=7, count=1) for k, name in enumerate(names.split())]
    step, count, data = 4 * len(fields), len(values), array.array("B", values.tobytes())
    steps = {"point_step": step, "row_step": step * count}
    return PointCloud2(header=HEAD, height=1, width=count, fields=fields, data=data, is_dense=True, **steps)


def test_clouds_are_those_of_rclpy(bent: Simulation) -> None:
    """A packed cloud of the bent state equals rclpy's, also after one of the undeformed state."""
    rest, fields = bent.mesh.vertices, bent.fields()
    mesh, strain = Packer(MESH, FRAME, len(rest)), Packer(STRAIN, FRAME, len(fields.J))
    mesh.pack(1, _mesh(rest, rest))
    moved = _cloud("x y z ux uy uz", bent.positions, bent.positions - rest)
    assert _same(mesh.pack(12_250_000_000, _mesh(bent.positions, rest)), moved)
    columns = (fields.centroids, fields.eps_eq, fields.J, fields.omega, fields.tangent, fields.energy_density)
    named = _cloud("x y z eps_eq J omega tangent energy_density", *columns)
    assert _same(strain.pack(12_250_000_000, _strain(fields)), named)


def test_velocities_are_those_of_rclpy(bent: Simulation) -> None:
    """A packed cloud of velocities equals rclpy's, also after another one."""
    packer, velocities = Packer(VELOCITY, FRAME, bent.mesh.n_vertices), np.sin(bent.positions)
    packer.pack(1, _numbers(bent.mesh.vertices, np.ones_like(velocities)))
    made = packer.pack(12_250_000_000, _numbers(bent.positions, velocities))
    assert _same(made, _cloud("x y z vx vy vz", bent.positions, velocities))


@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), (0.0, -0.3, 0.0), (5.0, 0.1, 0.0), (1e-9, 0.0, 0.0)])
def test_poses_are_those_of_rclpy(rotation: tuple[float, float, float]) -> None:
    """A packed pose equals rclpy's, for no rotation, a tiny one, and one beyond half a turn."""
    packer, pose = Packer(POSE, FRAME), Pose((0.1, -0.2, 0.3), rotation)
    message = messages.pose_stamped(HEAD, pose)
    assert isinstance(message, PoseStamped)
    packer.pack(3, _pose(Pose((9.0, 9.0, 9.0), (1.0, 1.0, 1.0))))
    assert _same(packer.pack(12_250_000_000, _pose(pose)), message)


def test_wrenches_are_those_of_rclpy() -> None:
    """A packed wrench equals rclpy's, also after another one."""
    packer, reaction = Packer(WRENCH, FRAME), np.array([1.0, -2.0, 3.0, -4.0, 5.0, 1e-12])
    force, torque = Vector3(x=1.0, y=-2.0, z=3.0), Vector3(x=-4.0, y=5.0, z=1e-12)
    packer.pack(3, _numbers(np.ones(6)))
    message = WrenchStamped(header=HEAD, wrench=Wrench(force=force, torque=torque))
    assert _same(packer.pack(12_250_000_000, _numbers(reaction)), message)


def test_readings_of_inertial_units_are_those_of_rclpy() -> None:
    """A packed IMU reading equals rclpy's, also after another one; covariances are zeros, for unknown."""
    packer, turn = Packer(IMU, FRAME), Rotation.from_rotvec([0.1, -0.2, 3.0])
    first, second = (
        ImuReading(orientation=each, angular_velocity=np.arange(3.0) * sign, linear_acceleration=np.full(3, sign / 3.0))
        for each, sign in ((turn.inv(), 1.0), (turn, -1.0))
    )
    packer.pack(3, _imu(first))
    x, y, z, w = turn.as_quat().tolist()
    message = Imu(
        header=HEAD,
        orientation=Quaternion(x=x, y=y, z=z, w=w),
        angular_velocity=Vector3(x=0.0, y=-1.0, z=-2.0),
        linear_acceleration=Vector3(x=-1.0 / 3.0, y=-1.0 / 3.0, z=-1.0 / 3.0),
    )
    assert _same(packer.pack(12_250_000_000, _imu(second)), message)
    assert not any([*message.orientation_covariance, *message.linear_acceleration_covariance])


def test_fields_of_a_body_far_away_are_published_where_it_is() -> None:
    """The fields of a bar 50 m away, evaluated later as in the node, have centroids in world coordinates."""
    scene = load_scene("bend5", overrides={"mesh.bar.cells": [5, 2, 2]})
    mesh = dataclasses.replace(scene.mesh, vertices=scene.mesh.vertices + np.array([50.0, 0.0, 0.0]))
    simulation = Simulation(dataclasses.replace(scene, mesh=mesh))
    later = simulation.later_fields()
    simulation.step(Command(handles={"tip": Pose((0.0, 0.0, 0.1))}))
    np.testing.assert_allclose(later().centroids, mesh.vertices[mesh.cells].mean(axis=1), atol=1e-9)
    assert later().centroids[:, 0].min() > 49.0
