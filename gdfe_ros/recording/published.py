# SPDX-License-Identifier: Apache-2.0
"""The numbers of a step's messages as tables, by topic; without ROS, so that replays make the same arrays as the node.

A table is a structured array: its columns have the names of the fields of the message, e.g. ``eps_eq`` of a cloud or
``pose.position.x``, and it has a row for each point of a cloud, or a single row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators import ActuatorState, Embedding, Mode, Readings
from gdfe_ros.constraints import Pose
from gdfe_ros.contacts import contact_names, contact_points
from gdfe_ros.recording.step import Step
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.forces.fields import ElementFields
from gdfe_ros.solver.motion.imu import ImuReading

_NO_TURN = (0.0, 0.0, 0.0, 1.0)


def _columns(kind: str, names: Iterable[str]) -> np.dtype:
    return np.dtype([(name, kind) for name in names])


def _vector(path: str, axes: str = "xyz") -> list[str]:
    return [f"{path}.{axis}" for axis in axes]


MESH = _columns("<f4", ("x", "y", "z", "ux", "uy", "uz"))
VELOCITY = _columns("<f4", ("x", "y", "z", "vx", "vy", "vz"))
STRAIN = _columns("<f4", ("x", "y", "z", "eps_eq", "J", "omega", "tangent", "energy_density"))
POSE = _columns("<f8", [*_vector("pose.position"), *_vector("pose.orientation", "xyzw")])
WRENCH = _columns("<f8", [*_vector("wrench.force"), *_vector("wrench.torque")])
IMU = _columns("<f8", [*_vector("orientation", "xyzw"), *_vector("angular_velocity"), *_vector("linear_acceleration")])
JOINTS = _columns("<f8", ("position", "velocity", "effort"))


@dataclass(frozen=True)
class Table:
    """How the numbers of a topic follow from a step.

    Attributes:
        part: attribute of `Step` that the table needs; the topic has no message for a step without it.
        make: function that returns the table of a step.
        kind: columns of the table; None if a message has other ones than the table, or as many rows as it happens.
    """

    part: str
    make: Callable[[Step], NDArray[np.void]]
    kind: np.dtype | None = None


def tables_of(scene: Scene) -> dict[str, Table]:
    """Return dict from topic, without the node's name, to its table, for all topics of a step that have numbers."""
    rest = scene.mesh.vertices
    found = {
        "mesh": Table("result", lambda step: mesh_table(step.result.positions, rest), MESH),
        "strain": Table("fields", lambda step: strain_table(step.fields()), STRAIN),
    }
    for handle in scene.handles:
        name, topic = handle.name, f"{handle.section}/{handle.name}"
        found[f"{topic}/pose"] = Table("poses", lambda step, name=name: pose_table(step.poses[name]), POSE)
        wrench = Table("result", lambda step, name=name: wrench_table(step.result.reactions[name]), WRENCH)
        found[f"{topic}/wrench"] = wrench
        if handle.section == "handles":
            found[f"{topic}/force_torque"] = Table("poses", lambda step, name=name: _force_torque(step, name), WRENCH)
    for name, point in scene.probes.items():
        probe = Table("result", lambda step, point=point: _probe(step, point, rest), POSE)
        found[f"probe/{name}"] = probe
    if contact_names(scene.handles, scene.self_contact):
        found["contacts"] = Table("result", lambda step: contact_points(step.result.contacts))
    for name, sensor in scene.sensors.items():
        felt = Table("result", lambda step, sensor=sensor: wrench_table(sensor.wrench(step.result)), WRENCH)
        found[f"sensors/{name}/wrench"] = felt
    if scene.dynamics:
        moving = Table("result", lambda step: velocity_table(step.result.positions, step.result.velocities), VELOCITY)
        found["velocity"] = moving
        for name in scene.probes:
            found[f"probe/{name}/imu"] = Table("imus", lambda step, name=name: imu_table(step.imus()[name]), IMU)
    if scene.actuators or scene.arms:
        found["joint_states"] = Table("actuators" if scene.actuators else "result", JointStates(scene).table)
    return found


def mesh_table(positions: NDArray[np.float64], rest: NDArray[np.float64]) -> NDArray[np.void]:
    """Return the table of vertices (n, 3) [m] with their displacements from ``rest`` (n, 3) [m]."""
    return _table(MESH, positions, positions - rest)


def velocity_table(positions: NDArray[np.float64], velocities: NDArray[np.float64]) -> NDArray[np.void]:
    """Return the table of vertices (n, 3) [m] with their velocities (n, 3) [m/s]."""
    return _table(VELOCITY, positions, velocities)


def strain_table(fields: ElementFields) -> NDArray[np.void]:
    """Return the table of the element fields, with a row for each cell."""
    return _table(STRAIN, fields.centroids, *(getattr(fields, name) for name in STRAIN.names[3:]))


def pose_table(pose: Pose) -> NDArray[np.void]:
    """Return the table of a pose; its rotation vector becomes a unit quaternion."""
    turn = Rotation.from_rotvec(pose.rotation).as_quat() if any(pose.rotation) else _NO_TURN
    return _table(POSE, [pose.translation], [turn])


def wrench_table(reaction: ArrayLike) -> NDArray[np.void]:
    """Return the table of a reaction (6,): force [N], then moment [N m]."""
    return _table(WRENCH, [reaction])


def imu_table(reading: ImuReading) -> NDArray[np.void]:
    """Return the table of an inertial unit's reading, without covariances."""
    return _table(IMU, [reading.orientation.as_quat()], [reading.angular_velocity], [reading.linear_acceleration])


def columns_of(table: NDArray[np.void]) -> dict[str, NDArray]:
    """Return the columns of a table (k,) by name."""
    return {name: np.ascontiguousarray(table[name]) for name in table.dtype.names}


def material_pose(point: Embedding, rest: NDArray[np.float64], positions: NDArray[np.float64]) -> Pose:
    """Return the position of a material point [m], and the rotation that best fits the corners of its cell."""
    corners = point.corners[0]
    before, now = rest[corners], positions[corners]
    turn, _ = Rotation.align_vectors(now - now.mean(axis=0), before - before.mean(axis=0))
    return Pose(tuple(point.at(positions)[0]), tuple(turn.as_rotvec()))


class JointStates:
    """Makes the tables of actuators and joints; it computes actuator velocities from successive steps.

    Args:
        scene: scene with the actuators.
    """

    def __init__(self, scene: Scene) -> None:
        self._readings = Readings(scene.actuators, scene.mesh.vertices)
        self._last: tuple[float, NDArray[np.float64]] | None = None

    def table(self, step: Step) -> NDArray[np.void]:
        """Return a row for each actuator, then for each joint.

        Velocities of actuators are averages since the last call, 0 if no time passed.
        """
        record, states, joints = step.record, step.actuators, list(step.joints.values())
        positions = self._readings.positions(states) if record.stamp is not None else _extents(states)
        velocities = np.zeros(len(positions))
        if self._last is not None and record.dt > 0.0 and record.time > self._last[0]:
            velocities = (positions - self._last[1]) / (record.time - self._last[0])
        self._last = (record.time, positions)
        table = np.empty(len(states) + len(joints), JOINTS)
        table["position"] = [*positions, *(joint.position for joint in joints)]
        table["velocity"] = [*velocities, *(joint.velocity for joint in joints)]
        table["effort"] = [*(state.effort for state in states.values()), *(joint.effort for joint in joints)]
        return table


def _extents(states: Mapping[str, ActuatorState]) -> NDArray[np.float64]:
    """Return the positions (k,) of actuators as in old bags, in which a shortening cable reports its length."""
    commanded = (Mode.GROWTH, Mode.GRIP)
    return np.array([each.command if each.mode in commanded else each.extent for each in states.values()])


def _probe(step: Step, point: Embedding, rest: NDArray[np.float64]) -> NDArray[np.void]:
    return pose_table(material_pose(point, rest, step.result.positions))


def _force_torque(step: Step, name: str) -> NDArray[np.void]:
    """Return the wrench of the body on a handle, in the axes of the handle."""
    back = Rotation.from_rotvec(step.poses[name].rotation).inv()
    return wrench_table(-back.apply(step.result.reactions[name].reshape(2, 3)).ravel())


def _table(kind: np.dtype, *parts: NDArray | Sequence) -> NDArray[np.void]:
    """Return a table whose columns are those of ``parts`` (k, c) or (k,), one after the other."""
    rows = np.empty((len(parts[0]), len(kind.names)), kind[0])
    place = 0
    for part in map(np.asarray, parts):
        width = part.shape[1] if part.ndim > 1 else 1
        rows[:, place : place + width] = part if part.ndim > 1 else part[:, None]
        place += width
    return rows.view(kind)[:, 0]
