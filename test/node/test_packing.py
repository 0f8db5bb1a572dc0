# SPDX-License-Identifier: Apache-2.0
"""The packed bytes equal the messages that rclpy makes of the same numbers."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.serialization import deserialize_message
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2

from gdfe_ros.constraints import Pose
from gdfe_ros.node import messages
from gdfe_ros.node.packing import ImuPacker, MeshPacker, PosePacker, StrainPacker, VelocityPacker, WrenchPacker
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.motion.imu import ImuReading

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


def test_clouds_are_those_of_rclpy(bent: Simulation) -> None:
    """A packed cloud of the bent state equals rclpy's, also after one of the undeformed state."""
    rest, fields = bent.mesh.vertices, bent.fields()
    mesh, strain = MeshPacker(rest, FRAME), StrainPacker(fields, FRAME)
    mesh.pack(1, rest)
    assert _same(mesh.pack(12_250_000_000, bent.positions), messages.mesh_cloud(HEAD, bent.positions, rest))
    assert _same(strain.pack(12_250_000_000, fields), messages.strain_cloud(HEAD, fields))
    assert isinstance(deserialize_message(strain.pack(12_250_000_000, fields), PointCloud2), PointCloud2)


def test_velocities_are_those_of_rclpy(bent: Simulation) -> None:
    """A packed cloud of velocities equals rclpy's, also after another one."""
    packer, velocities = VelocityPacker(bent.mesh.vertices, FRAME), np.sin(bent.positions)
    packer.pack(1, bent.mesh.vertices, np.ones_like(velocities))
    made = packer.pack(12_250_000_000, bent.positions, velocities)
    assert _same(made, messages.velocity_cloud(HEAD, bent.positions, velocities))


@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), (0.0, -0.3, 0.0), (5.0, 0.1, 0.0), (1e-9, 0.0, 0.0)])
def test_poses_are_those_of_rclpy(rotation: tuple[float, float, float]) -> None:
    """A packed pose equals rclpy's, for no rotation, a tiny one, and one beyond half a turn."""
    packer, pose = PosePacker(FRAME), Pose((0.1, -0.2, 0.3), rotation)
    message = messages.pose_stamped(HEAD, pose)
    assert isinstance(message, PoseStamped)
    packer.pack(3, Pose((9.0, 9.0, 9.0), (1.0, 1.0, 1.0)))
    assert _same(packer.pack(12_250_000_000, pose), message)


def test_wrenches_are_those_of_rclpy() -> None:
    """A packed wrench equals rclpy's, also after another one."""
    packer, reaction = WrenchPacker(FRAME), np.array([1.0, -2.0, 3.0, -4.0, 5.0, 1e-12])
    message = messages.wrench_stamped(HEAD, reaction)
    assert isinstance(message, WrenchStamped)
    packer.pack(3, np.ones(6))
    assert _same(packer.pack(12_250_000_000, reaction), message)


def test_readings_of_inertial_units_are_those_of_rclpy() -> None:
    """A packed IMU reading equals rclpy's, also after another one; covariances are zeros, for unknown."""
    packer, turn = ImuPacker(FRAME), Rotation.from_rotvec([0.1, -0.2, 3.0])
    first, second = (
        ImuReading(orientation=each, angular_velocity=np.arange(3.0) * sign, linear_acceleration=np.full(3, sign / 3.0))
        for each, sign in ((turn.inv(), 1.0), (turn, -1.0))
    )
    packer.pack(3, first)
    message = messages.imu(HEAD, second)
    assert _same(packer.pack(12_250_000_000, second), message)
    assert message.orientation.z == turn.as_quat()[2]
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
