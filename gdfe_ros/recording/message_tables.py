# SPDX-License-Identifier: Apache-2.0
"""The numbers of a step's messages as tables, by topic; without ROS, so that replays make the same arrays as the node.

The columns of a table have the names of the fields of the message, e.g. ``eps_eq`` of a cloud or ``pose.position.x``.
A table has a row for each point of a cloud, or a single row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators import Embedding
from gdfe_ros.actuators.actuator import Readings
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.constraints.obstacle import ArmLink
from gdfe_ros.recording.step import Step
from gdfe_ros.results.contacts import POINT, ContactSensor, contact_names, contact_points
from gdfe_ros.results.element_fields import ElementFields
from gdfe_ros.results.inertial_units import ImuReading
from gdfe_ros.scene.scene import Scene

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
PLACE = _columns("<f8", _vector("point"))
JOINTS = _columns("<f8", ("position", "velocity", "effort"))


@dataclass(frozen=True, kw_only=True)
class Table:
    """Columns of a topic, and their computation from a step: ``write`` if all tables have one size, else ``make``.

    Attributes:
        frame: coordinate frame of the message, e.g. ``tip_rest``; empty: the frame of the rest shape.
        kind: columns of the table.
        count: number of rows.
        write: function that writes the numbers of a step into an array (count, columns).
        make: function that returns the table of a step, a structured array.
    """

    frame: str = ""
    kind: np.dtype
    count: int = 1
    write: Callable[[Step, NDArray], None] | None = None
    make: Callable[[Step], NDArray[np.void]] | None = None

    def columns(self, step: Step) -> dict[str, NDArray]:
        """Return the columns (k,) of the table of a step by name."""
        if self.make is not None:
            table = self.make(step)
            return {name: np.ascontiguousarray(table[name]) for name in self.kind.names}
        rows = np.empty((self.count, len(self.kind.names)), self.kind[0])
        self.write(step, rows)
        return dict(zip(self.kind.names, np.ascontiguousarray(rows.T), strict=True))


def tables_of(scene: Scene) -> dict[str, Table]:
    """Return a dict from topic, without the node's name, to its table, for all numeric topics of a step."""
    mesh, rest = scene.mesh, scene.mesh.vertices
    found = {
        "mesh": Table(
            kind=MESH, count=mesh.n_vertices, write=lambda step, rows: write_mesh(rows, step.result.positions, rest)
        ),
        "strain": Table(kind=STRAIN, count=mesh.n_cells, write=lambda step, rows: write_strain(rows, step.fields())),
    }
    for handle in scene.handles:
        found |= _tables_of_handle(handle)
    for name, point in scene.probes.items():
        found[f"probe/{name}"] = Table(kind=POSE, write=partial(_write_probe, point, rest))
    if contact_names(scene.handles, scene.self_contact):
        found["contacts"] = Table(kind=POINT, make=lambda step: contact_points(step.result.contacts))
    for name, sensor in scene.sensors.items():
        found[f"sensors/{name}/wrench"] = Table(frame=f"{name}_sensor", kind=WRENCH, write=partial(_write_felt, sensor))
    if scene.dynamics:
        found["velocity"] = Table(kind=VELOCITY, count=mesh.n_vertices, write=_write_velocities)
        for name in scene.probes:
            found[f"probe/{name}/imu"] = Table(frame=f"{name}_imu", kind=IMU, write=partial(_write_reading, name))
    if scene.actuators or scene.arms:
        found["joint_states"] = Table(kind=JOINTS, make=JointStates(scene).table)
    return found


def _tables_of_handle(handle: Handle) -> dict[str, Table]:
    name, topic = handle.name, f"{handle.section}/{handle.name}"
    # Pieces of links have no frames of their own: the frames of links are on TF.
    rest, centre = ("", "") if isinstance(handle, ArmLink) else (f"{name}_rest", f"{name}_centre")
    found = {
        f"{topic}/pose": Table(frame=rest, kind=POSE, write=lambda step, rows: write_pose(rows, step.poses[name])),
        f"{topic}/wrench": Table(frame=centre, kind=WRENCH, write=partial(_write_reaction, name)),
    }
    if handle.section == "handles":
        found[f"{topic}/force_torque"] = Table(frame=name, kind=WRENCH, write=partial(_write_force_torque, name))
    return found


def write_mesh(rows: NDArray, positions: NDArray[np.float64], rest: NDArray[np.float64]) -> None:
    """Write vertices (n, 3) [m] and their displacements from ``rest`` (n, 3) [m] into ``rows`` (n, 6)."""
    rows[:, :3] = positions
    np.subtract(positions, rest, out=rows[:, 3:], casting="same_kind")


def write_strain(rows: NDArray, fields: ElementFields) -> None:
    """Write the element fields into ``rows`` (m, 8), one row for each cell."""
    rows[:, :3] = fields.centroids
    for column, name in enumerate(STRAIN.names[3:], start=3):
        rows[:, column] = getattr(fields, name)


def write_pose(rows: NDArray, pose: Pose) -> None:
    """Write a pose into ``rows`` (1, 7); its rotation vector becomes a unit quaternion."""
    rows[0, :3] = pose.translation
    rows[0, 3:] = Rotation.from_rotvec(pose.rotation).as_quat() if any(pose.rotation) else _NO_TURN


def write_imu(rows: NDArray, reading: ImuReading) -> None:
    """Write an inertial unit's reading, without covariances, into ``rows`` (1, 10)."""
    rows[0, :4] = reading.orientation.as_quat()
    rows[0, 4:7], rows[0, 7:] = reading.angular_velocity, reading.linear_acceleration


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
        positions = self._readings.positions(states)
        velocities = np.zeros(len(positions))
        if self._last is not None and record.dt > 0.0 and record.time > self._last[0]:
            velocities = (positions - self._last[1]) / (record.time - self._last[0])
        self._last = (record.time, positions)
        table = np.empty(len(states) + len(joints), JOINTS)
        table["position"] = [*positions, *(joint.position for joint in joints)]
        table["velocity"] = [*velocities, *(joint.velocity for joint in joints)]
        table["effort"] = [*(state.effort for state in states.values()), *(joint.effort for joint in joints)]
        return table


def _write_probe(point: Embedding, rest: NDArray[np.float64], step: Step, rows: NDArray) -> None:
    write_pose(rows, material_pose(point, rest, step.result.positions))


def _write_felt(sensor: ContactSensor, step: Step, rows: NDArray) -> None:
    rows[0] = sensor.wrench(step.result)


def _write_reaction(handle: str, step: Step, rows: NDArray) -> None:
    rows[0] = step.result.reactions[handle]


def _write_velocities(step: Step, rows: NDArray) -> None:
    rows[:, :3], rows[:, 3:] = step.result.positions, step.result.velocities


def _write_reading(probe: str, step: Step, rows: NDArray) -> None:
    write_imu(rows, step.imus()[probe])


def _write_force_torque(handle: str, step: Step, rows: NDArray) -> None:
    """Write the wrench of the body on a handle, in the axes of the handle."""
    back = Rotation.from_rotvec(step.poses[handle].rotation).inv()
    rows[0] = -back.apply(step.result.reactions[handle].reshape(2, 3)).ravel()
