# SPDX-License-Identifier: Apache-2.0
"""State after a step, from the contents of the node's messages, for a controller under test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, PointCloud2

from gdfe_ros.constraints import Pose
from gdfe_ros.contacts import POINT
from gdfe_ros.node.interface import topics
from gdfe_ros.node.interface.scene_topics import pose_and_wrench
from gdfe_ros.node.messages import to_time
from gdfe_ros.recording.step_record import StepRecord
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.motion.imu import ImuReading

Moment = tuple[int, int]


@dataclass(frozen=True, eq=False)
class PublishedState:
    """State of the simulation after one step, as published.

    Attributes:
        record: commands that the step consumed, and the result of its solve.
        positions: (n, 3) float32 positions of the vertices [m].
        displacements: (n, 3) float32 displacements of the vertices [m].
        strain: (m, 8) float32 fields of the cells, columns as in ``~/strain``.
        poses: poses of handles, obstacles and rigid bodies by name, relative to rest.
        wrenches: wrenches (6,) of handles, obstacles and rigid bodies on the body by name, force [N] then moment [N m].
        probes: poses of the material points by name.
        joints: position, velocity and effort of each actuator and joint by name, as in ``~/joint_states``.
        contacts: (k,) contact points, as `gdfe_ros.contacts.POINT`; empty in a scene without contact.
        sensors: wrenches (6,) measured by contact sensors, by name, force [N] then moment [N m].
        velocities: (n, 3) float32 velocities of the vertices [m/s]; None if the scene has no dynamics.
        imus: readings of inertial measurement units at the probes by name, as from `Simulation.imus`; empty without
            dynamics.
    """

    record: StepRecord
    positions: NDArray[np.float32]
    displacements: NDArray[np.float32]
    strain: NDArray[np.float32]
    poses: Mapping[str, Pose]
    wrenches: Mapping[str, NDArray[np.float64]]
    probes: Mapping[str, Pose]
    joints: Mapping[str, tuple[float, float, float]]
    contacts: NDArray[np.void]
    sensors: Mapping[str, NDArray[np.float64]]
    velocities: NDArray[np.float32] | None = None
    imus: Mapping[str, ImuReading] = field(default_factory=dict)

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self.record.time


def moment_of(message: Any) -> Moment:
    """Return the stamp of a message on one of ``state_topics``, in seconds and nanoseconds; it identifies the step."""
    given = message.header.stamp if hasattr(message, "header") else to_time(StepRecord.from_json(message.data).stamp)
    return given.sec, given.nanosec


def unpack(scene: Scene, messages: Mapping[str, Any]) -> PublishedState:
    """Return the state after a step from the step's messages, one for each of ``state_topics``."""
    mesh, moving = _vertices(messages[topics.MESH.key()]), scene.dynamics is not None
    joints = messages.get(topics.JOINT_STATES.key())
    poses, wrenches = {}, {}
    for handle in scene.handles:
        pose, wrench = (messages[key] for key in pose_and_wrench(handle))
        poses[handle.name], wrenches[handle.name] = _pose(pose), _wrench(wrench)
    points, felt = messages.get(topics.CONTACTS.key()), topics.SENSOR_WRENCH
    return PublishedState(
        record=StepRecord.from_json(messages[topics.STEP_RECORD.key()].data),
        positions=mesh[:, :3],
        displacements=mesh[:, 3:],
        strain=np.frombuffer(messages[topics.STRAIN.key()].data, "<f4").reshape(-1, 8),
        poses=poses,
        wrenches=wrenches,
        probes={name: _pose(messages[topics.PROBE.key(probe=name)]) for name in scene.probes},
        contacts=np.frombuffer(b"" if points is None else points.data, POINT),
        sensors={name: _wrench(messages[felt.key(sensor=name)]) for name in scene.sensors},
        joints={}
        if joints is None
        else dict(zip(joints.name, zip(joints.position, joints.velocity, joints.effort, strict=True), strict=True)),
        velocities=_vertices(messages[topics.VERTEX_VELOCITY.key()])[:, 3:] if moving else None,
        imus={name: _imu(messages[topics.IMU.key(probe=name)]) for name in scene.probes if moving},
    )


def _vertices(message: PointCloud2) -> NDArray[np.float32]:
    """Return the values (n, 6) of a point cloud of vertices."""
    return np.frombuffer(message.data, "<f4").reshape(-1, 6)


def _pose(message: PoseStamped) -> Pose:
    position, turn = message.pose.position, message.pose.orientation
    rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_rotvec()
    return Pose((position.x, position.y, position.z), tuple(rotation))


def _imu(message: Imu) -> ImuReading:
    turn, rate, push = message.orientation, message.angular_velocity, message.linear_acceleration
    return ImuReading(
        orientation=Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]),
        angular_velocity=np.array([rate.x, rate.y, rate.z]),
        linear_acceleration=np.array([push.x, push.y, push.z]),
    )


def _wrench(message: Any) -> NDArray[np.float64]:
    force, torque = message.wrench.force, message.wrench.torque
    return np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])
