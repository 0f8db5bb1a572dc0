# SPDX-License-Identifier: Apache-2.0
"""The arrays that the node would publish for the present state of a simulation, made without ROS."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators import ActuatorState, Mode, Readings
from gdfe_ros.analysis.bag_run import CONTACTS, RECORD
from gdfe_ros.analysis.difference import VELOCITIES
from gdfe_ros.analysis.message_values import Values, record_values
from gdfe_ros.contacts import contact_names, contact_points
from gdfe_ros.recording.step_record import StepRecord
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.motion.imu import ImuReading
from gdfe_ros.solver.result import StepResult

STRAIN_FIELDS = ("eps_eq", "J", "omega", "tangent", "energy_density")
_OUTCOMES = ("converged", "iterations", "substeps", "error_estimate", "energy", "min_det", "skipped", "energies")


class Publication:
    """Makes the arrays of each step's messages, in their published types.

    Args:
        simulation: the stepped simulation.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._readings = Readings(simulation.scene.actuators, simulation.mesh.vertices)
        self._joints: tuple[float, NDArray[np.float64]] | None = None

    def values(self, result: StepResult, record: StepRecord, topics: Collection[str]) -> dict[str, Values]:
        """Return the arrays of the last step's messages, by topic and field.

        Args:
            result: result of the last step.
            record: record of the recorded step that was repeated.
            topics: names without the node's name; topics for which the simulation has no arrays are left out.
        """
        makers = self._makers(result, record)
        return {topic: makers[topic]() for topic in topics if topic in makers}

    def _makers(self, result: StepResult, record: StepRecord) -> dict[str, Callable[[], Values]]:
        simulation = self._simulation
        makers: dict[str, Callable[[], Values]] = {
            "mesh": lambda: _mesh(simulation, result),
            "strain": lambda: _strain(simulation),
            RECORD: lambda: _record(result, record),
        }
        for handle in simulation.scene.handles:
            name, topic = handle.name, f"{handle.section}/{handle.name}"
            makers[f"{topic}/pose"] = lambda name=name: _handle(simulation, name)
            makers[f"{topic}/wrench"] = lambda name=name: _wrench(result.reactions[name])
        if contact_names(simulation.scene.handles, simulation.scene.self_contact):
            makers[CONTACTS] = lambda: _contacts(result)
        for name, sensor in simulation.scene.sensors.items():
            makers[f"sensors/{name}/wrench"] = lambda sensor=sensor: _wrench(sensor.wrench(result))
        for name in simulation.scene.probes:
            makers[f"probe/{name}"] = lambda name=name: _probe(simulation, name, result.positions)
        if simulation.scene.dynamics:
            makers["velocity"] = lambda: _velocity(result)
            imus = simulation.later_imus()
            makers |= {f"probe/{name}/imu": lambda name=name: _imu(imus()[name]) for name in simulation.scene.probes}
        if simulation.actuator_names or simulation.scene.arms:
            makers["joint_states"] = lambda: self._joint_states(record)
        return makers

    def _joint_states(self, record: StepRecord) -> Values:
        """Return joint states; a velocity is the change of position divided by the time since the last step."""
        states, time = self._simulation.actuator_states(), record.time
        positions = self._readings.positions(states)
        if record.stamp is None:  # an old bag, in which a shortening cable reports its length
            positions = np.array([_extent(state) for state in states.values()])
        velocities = np.zeros(len(positions))
        if self._joints is not None and record.dt > 0.0 and time > self._joints[0]:
            velocities = (positions - self._joints[1]) / (time - self._joints[0])
        self._joints = (time, positions)
        joints = self._simulation.joint_states().values()
        efforts = np.array([*(state.effort for state in states.values()), *(joint.effort for joint in joints)])
        return {
            "position": np.append(positions, [joint.position for joint in joints]),
            "velocity": np.append(velocities, [joint.velocity for joint in joints]),
            "effort": efforts.astype(np.float64),
        }


def _mesh(simulation: Simulation, result: StepResult) -> Values:
    shift = result.positions - simulation.mesh.vertices
    columns = [*result.positions.T, *shift.T]
    return {name: values.astype("<f4") for name, values in zip(("x", "y", "z", "ux", "uy", "uz"), columns, strict=True)}


def _contacts(result: StepResult) -> Values:
    points = contact_points(result.contacts)
    return {name: np.ascontiguousarray(points[name]) for name in points.dtype.names}


def _velocity(result: StepResult) -> Values:
    columns = [*result.positions.T, *result.velocities.T]
    names = ("x", "y", "z", *VELOCITIES)
    return {name: values.astype("<f4") for name, values in zip(names, columns, strict=True)}


def _strain(simulation: Simulation) -> Values:
    fields = simulation.fields()
    columns = dict(zip("xyz", fields.centroids.T, strict=True)) | {
        name: getattr(fields, name) for name in STRAIN_FIELDS
    }
    return {name: values.astype("<f4") for name, values in columns.items()}


def _record(result: StepResult, record: StepRecord) -> Values:
    outcomes = {name: getattr(result, name) for name in _OUTCOMES}
    return record_values(StepRecord(step=record.step, begin=record.begin, time=result.time, dt=record.dt, **outcomes))


def _handle(simulation: Simulation, name: str) -> Values:
    pose = simulation.handle_pose(name)
    return _pose(pose.translation, pose.rotation)


def _probe(simulation: Simulation, name: str, positions: NDArray[np.float64]) -> Values:
    """Return the pose of a probe: its position, and the rotation that best fits the corners of its cell."""
    point = simulation.scene.probes[name]
    before, now = simulation.mesh.vertices[point.corners[0]], positions[point.corners[0]]
    turn, _ = Rotation.align_vectors(now - now.mean(axis=0), before - before.mean(axis=0))
    return _pose(point.at(positions)[0], turn.as_rotvec())


def _imu(reading: ImuReading) -> Values:
    vectors = {
        "orientation": reading.orientation.as_quat(),
        "angular_velocity": reading.angular_velocity,
        "linear_acceleration": reading.linear_acceleration,
    }
    return {field: entry for name, vector in vectors.items() for field, entry in _entries(name, vector)}


def _pose(translation: Collection[float], rotation: Collection[float]) -> Values:
    turn = Rotation.from_rotvec(rotation).as_quat()
    return dict(_entries("pose.position", translation)) | dict(_entries("pose.orientation", turn))


def _wrench(reaction: NDArray[np.float64]) -> Values:
    return dict(_entries("wrench.force", reaction[:3])) | dict(_entries("wrench.torque", reaction[3:]))


def _extent(state: ActuatorState) -> float:
    return state.command if state.mode in (Mode.GROWTH, Mode.GRIP) else state.extent


def _entries(path: str, values: Collection[float]) -> Iterator[tuple[str, np.ndarray]]:
    for axis, value in zip("xyzw", values, strict=False):
        yield f"{path}.{axis}", np.array([value], dtype=np.float64)
