# SPDX-License-Identifier: Apache-2.0
"""Packing of arrays and results into ROS messages.

``PointCloud2`` contains float32, because RViz accepts nothing else for x, y, z. Bytes are passed as ``array.array``,
the one type that is fast with and without rclpy's field checks.
"""

from __future__ import annotations

import array
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    PoseStamped,
    Quaternion,
    Vector3,
    Wrench,
    WrenchStamped,
)
from geometry_msgs.msg import (
    Pose as PoseMessage,
)
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, JointState, PointCloud2, PointField
from std_msgs.msg import Float64MultiArray, Header, Int32MultiArray, MultiArrayDimension, MultiArrayLayout, String

from gdfe_ros.actuators import Actuator, Embedding, Readings
from gdfe_ros.constraints import Pose
from gdfe_ros.element_fields import ElementFields
from gdfe_ros.node.actuator_orders import EFFORTS
from gdfe_ros.node.plain_log import shorten
from gdfe_ros.node.refusals import LONGEST, Refusal
from gdfe_ros.node.step import Step
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.motion.imu import ImuReading

MESH_FIELDS = ("x", "y", "z", "ux", "uy", "uz")
VELOCITY_FIELDS = ("x", "y", "z", "vx", "vy", "vz")
STRAIN_FIELDS = ("x", "y", "z", "eps_eq", "J", "omega", "tangent", "energy_density")


def to_time(nanoseconds: int) -> Time:
    """Return a time in nanoseconds as a Time message."""
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def header(stamp: int, frame_id: str) -> Header:
    """Return a header with a stamp [ns]."""
    return Header(stamp=to_time(stamp), frame_id=frame_id)


def mesh_cloud(head: Header, positions: NDArray[np.float64], rest: NDArray[np.float64]) -> PointCloud2:
    """Return a cloud of current vertices (n, 3) [m] with their displacements from ``rest`` (n, 3) [m]."""
    values = np.empty((len(rest), 6), dtype="<f4")
    values[:, :3] = positions
    values[:, 3:] = positions - rest
    return _cloud(head, MESH_FIELDS, values)


def velocity_cloud(head: Header, positions: NDArray[np.float64], velocities: NDArray[np.float64]) -> PointCloud2:
    """Return a cloud of current vertices (n, 3) [m] with their velocities (n, 3) [m/s]."""
    values = np.hstack([positions, velocities]).astype("<f4")
    return _cloud(head, VELOCITY_FIELDS, values)


def strain_cloud(head: Header, fields: ElementFields) -> PointCloud2:
    """Return a cloud of the element fields, one point for each cell."""
    values = np.empty((len(fields.J), 8), dtype="<f4")
    values[:, :3] = fields.centroids
    for column, name in enumerate(STRAIN_FIELDS[3:], start=3):
        values[:, column] = getattr(fields, name)
    return _cloud(head, STRAIN_FIELDS, values)


def contact_cloud(head: Header, points: NDArray[np.void]) -> PointCloud2:
    """Return a cloud of the contact points, given as `gdfe_ros.contacts.POINT`."""
    kinds = {"f": PointField.FLOAT32, "i": PointField.INT32}
    fields = [(name, kinds[points.dtype[name].kind]) for name in points.dtype.names]
    return _cloud(head, fields, points)


def pose_stamped(head: Header, pose: Pose) -> PoseStamped:
    """Return the message of a pose relative to rest; its rotation vector becomes a unit quaternion."""
    x, y, z, w = map(float, Rotation.from_rotvec(pose.rotation).as_quat())
    px, py, pz = pose.translation
    return PoseStamped(
        header=head,
        pose=PoseMessage(position=Point(x=px, y=py, z=pz), orientation=Quaternion(x=x, y=y, z=z, w=w)),
    )


def material_pose(point: Embedding, rest: NDArray[np.float64], positions: NDArray[np.float64]) -> Pose:
    """Return the position of a material point [m], and the rotation that best fits the corners of its cell."""
    corners = point.corners[0]
    before, now = rest[corners], positions[corners]
    turn, _ = Rotation.align_vectors(now - now.mean(axis=0), before - before.mean(axis=0))
    return Pose(tuple(point.at(positions)[0]), tuple(turn.as_rotvec()))


def wrench_stamped(head: Header, reaction: NDArray[np.float64]) -> WrenchStamped:
    """Return the message of a reaction (6,): force [N], then moment [N m]."""
    fx, fy, fz, mx, my, mz = map(float, reaction)
    wrench = Wrench(force=Vector3(x=fx, y=fy, z=fz), torque=Vector3(x=mx, y=my, z=mz))
    return WrenchStamped(header=head, wrench=wrench)


def imu(head: Header, reading: ImuReading) -> Imu:
    """Return the message of an inertial unit's reading; all covariances are 0, which means unknown."""
    x, y, z, w = map(float, reading.orientation.as_quat())
    turn, felt = (map(float, each) for each in (reading.angular_velocity, reading.linear_acceleration))
    return Imu(
        header=head,
        orientation=Quaternion(x=x, y=y, z=z, w=w),
        angular_velocity=Vector3(**dict(zip("xyz", turn, strict=True))),
        linear_acceleration=Vector3(**dict(zip("xyz", felt, strict=True))),
    )


def topology(cells: NDArray[np.int32]) -> Int32MultiArray:
    """Return a message with the vertex ids of the cells (m, c), row by row."""
    count, corners = cells.shape
    data = array.array("i")
    data.frombytes(np.ascontiguousarray(cells, dtype=np.int32).tobytes())
    dimensions = [
        MultiArrayDimension(label="cells", size=count, stride=count * corners),
        MultiArrayDimension(label="corners", size=corners, stride=corners),
    ]
    return Int32MultiArray(layout=MultiArrayLayout(dim=dimensions, data_offset=0), data=data)


class ActuatorStates:
    """Makes JointState messages of actuators and joints; it computes actuator velocities from successive steps.

    Args:
        scene: scene with the actuators.
    """

    def __init__(self, scene: Scene) -> None:
        self._readings = Readings(scene.actuators, scene.mesh.vertices)
        self._last: tuple[float, NDArray[np.float64]] | None = None

    def message(self, head: Header, step: Step) -> JointState:
        """Return the message of a step. Actuator velocities are averages since the last call, 0 if no time passed."""
        states = step.actuators.values()
        positions = self._readings.positions(step.actuators)
        velocities = np.zeros(len(positions))
        if self._last is not None and step.record.dt > 0.0 and step.record.time > self._last[0]:
            velocities = (positions - self._last[1]) / (step.record.time - self._last[0])
        self._last = (step.record.time, positions)
        efforts, joints = [state.effort for state in states], step.joints.values()
        return JointState(
            header=head,
            name=[*step.actuators, *step.joints],
            position=_doubles(np.append(positions, [joint.position for joint in joints])),
            velocity=_doubles(np.append(velocities, [joint.velocity for joint in joints])),
            effort=_doubles(np.array([*efforts, *(joint.effort for joint in joints)])),
        )


def actuation(actuators: Mapping[str, Actuator], values: Mapping[str, float]) -> JointState:
    """Return a message of commands by name: tensions and pressures in ``effort``, all others in ``position``."""
    forced = [name in actuators and actuators[name].mode in EFFORTS for name in values]
    pairs = list(zip(forced, map(float, values.values()), strict=True))
    return JointState(
        name=list(values),
        position=[math.nan if force else value for force, value in pairs],
        effort=[value if force else math.nan for force, value in pairs],
    )


def refused(source: str, refusal: Refusal) -> String:
    """Return the message about a command on topic ``source`` that was refused, as JSON text."""
    entries = {"source": source, "reason": refusal.reason.value, "message": shorten(str(refusal), LONGEST)}
    return String(data=json.dumps(entries))


def jacobian(values: NDArray[np.float64], probes: list[str], actuators: list[str]) -> Float64MultiArray:
    """Return the message of a Jacobian (probes, 3, actuators); its layout's labels name probes, axes, actuators."""
    labels = (",".join(probes), "x,y,z", ",".join(actuators))
    strides = np.cumprod(values.shape[::-1])[::-1]
    dimensions = [
        MultiArrayDimension(label=label, size=size, stride=int(stride))
        for label, size, stride in zip(labels, values.shape, strides, strict=True)
    ]
    return Float64MultiArray(layout=MultiArrayLayout(dim=dimensions, data_offset=0), data=_doubles(values))


def _doubles(values: NDArray[np.float64]) -> array.array:
    return array.array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def _cloud(head: Header, fields: Sequence[str | tuple[str, int]], values: NDArray[Any]) -> PointCloud2:
    """Return a cloud with a point for each row of ``values`` (k, c).

    A field is a name, for float32, or a name with a type of four bytes.
    """
    data = array.array("B")
    data.frombytes(values.tobytes())
    kinds = [(each, PointField.FLOAT32) if isinstance(each, str) else each for each in fields]
    step = 4 * len(kinds)
    return PointCloud2(
        header=head,
        height=1,
        width=len(values),
        fields=[
            PointField(name=name, offset=4 * place, datatype=kind, count=1) for place, (name, kind) in enumerate(kinds)
        ],
        is_bigendian=False,
        point_step=step,
        row_step=step * len(values),
        data=data,
        is_dense=True,
    )
