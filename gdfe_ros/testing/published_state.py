# SPDX-License-Identifier: Apache-2.0
"""State after a step, unpacked from the node's messages, for a controller under test; and its tracking error."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, PointCloud2

from gdfe_ros.constraints import Pose
from gdfe_ros.node.interface import topics
from gdfe_ros.node.messages import to_time
from gdfe_ros.recording.message_tables import IMU, POSE, WRENCH
from gdfe_ros.recording.step import StepRecord
from gdfe_ros.results.contacts import POINT
from gdfe_ros.results.inertial_units import ImuReading
from gdfe_ros.scene.scene import Scene

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
        contacts: (k,) contact points, as `gdfe_ros.results.contacts.POINT`; empty in a scene without contact.
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


class StepMessages:
    """Collects the messages of steps until all messages of one step have arrived.

    Older steps are then dropped. They are incomplete if a slow subscriber has lost a message.

    Args:
        topics: topics of a step, one message each.
        most: largest number of incomplete steps that are stored.
    """

    def __init__(self, topics: Collection[str], *, most: int) -> None:
        self._count, self._most = len(topics), most
        self._parts: dict[Moment, dict[str, Any]] = {}

    def add(self, topic: str, message: Any) -> dict[str, Any] | None:
        """Store a message on a topic; return the messages of its step by topic if they are complete, else None."""
        moment = moment_of(message)
        parts = self._parts.setdefault(moment, {})
        parts[topic] = message
        if len(parts) == self._count:
            while self._parts.pop(next(iter(self._parts))) is not parts:
                pass
            return parts
        while len(self._parts) > self._most:
            del self._parts[next(iter(self._parts))]
        return None


def unpack(scene: Scene, messages: Mapping[str, Any]) -> PublishedState:
    """Return the state after a step from the step's messages, one for each of ``state_topics``."""
    mesh, moving = _vertices(messages[topics.MESH.key()]), scene.dynamics is not None
    joints = messages.get(topics.JOINT_STATES.key())
    poses, wrenches = {}, {}
    for handle in scene.handles:
        pose, wrench = (messages[f"{handle.section}/{handle.name}/{what}"] for what in ("pose", "wrench"))
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


def _numbers(message: Any, kind: np.dtype) -> NDArray[np.float64]:
    """Return the numbers of a message in the columns of its table, see `gdfe_ros.recording.message_tables`."""
    return np.array(attrgetter(*kind.names)(message))


def _pose(message: PoseStamped) -> Pose:
    numbers = _numbers(message, POSE)
    return Pose(tuple(numbers[:3].tolist()), tuple(Rotation.from_quat(numbers[3:]).as_rotvec()))


def _imu(message: Imu) -> ImuReading:
    numbers = _numbers(message, IMU)
    return ImuReading(
        orientation=Rotation.from_quat(numbers[:4]), angular_velocity=numbers[4:7], linear_acceleration=numbers[7:]
    )


def _wrench(message: WrenchStamped) -> NDArray[np.float64]:
    return _numbers(message, WRENCH)


@dataclass(frozen=True)
class TrackingError:
    """Distances between actual and wanted positions.

    Attributes:
        largest: largest distance [m].
        rms: root mean square of the distances [m].
        last: distance at the end [m].
    """

    largest: float
    rms: float
    last: float


def tracking_error(actual: ArrayLike, wanted: ArrayLike) -> TrackingError:
    """Return largest, RMS and last distance between an actual and a wanted motion.

    Args:
        actual: (k, 3) positions [m].
        wanted: (k, 3), or one position (3,) for all [m].

    Raises:
        ValueError: the shapes do not fit, an array is empty, or a value is not finite.
    """
    actual, wanted = np.asarray(actual, dtype=np.float64), np.asarray(wanted, dtype=np.float64)
    if actual.ndim != 2 or actual.shape[1:] != (3,) or wanted.shape not in ((3,), actual.shape) or not len(actual):
        raise ValueError(f"actual must be (k, 3) and wanted (k, 3) or (3,), got {actual.shape} and {wanted.shape}")
    distances = np.linalg.norm(actual - wanted, axis=1)
    if not np.isfinite(distances).all():
        raise ValueError("positions must be finite numbers")
    return TrackingError(float(distances.max()), float(np.sqrt((distances**2).mean())), float(distances[-1]))
