# SPDX-License-Identifier: Apache-2.0
"""A program: poses of handles, commands of actuators and loads, and positions of joints over time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gdfe_ros.arms.spline import spline
from gdfe_ros.constraints import Pose


@dataclass(frozen=True)
class Keyframe:
    """The pose of a handle at a time [s]."""

    time: float
    pose: Pose


@dataclass(frozen=True)
class Point:
    """The command of an actuator, in its unit, or the factor of a load, at a time [s]."""

    time: float
    value: float


@dataclass(frozen=True)
class JointPoint:
    """Position [rad] or [m] and velocity [rad/s] or [m/s] of a joint at a time [s]."""

    time: float
    value: float
    velocity: float = 0.0


@dataclass(frozen=True)
class Program:
    """Keyframes of handles, obstacles, actuators, loads and joints.

    At time 0 a handle is in its rest pose, unless it has a keyframe at time 0. Between two keyframes its pose changes
    linearly. After its last keyframe it keeps the pose of that keyframe. The same holds for the commands of actuators
    and loads, which have the values in `start` at time 0. Between two points of a joint its position is a cubic
    polynomial.

    Attributes:
        duration: length of the program [s].
        keyframes: dict from the name of a handle or obstacle to its keyframes, times ascending and within the duration.
        actuators: dict from the name of an actuator to its commands, times likewise.
        loads: dict from the name of a load to its factors, times likewise.
        start: dict from the name of an actuator, load or joint to its command at time 0, if its first point is later.
        joints: dict from the name of an arm's joint to its positions and velocities, times likewise.
    """

    duration: float
    keyframes: Mapping[str, tuple[Keyframe, ...]]
    actuators: Mapping[str, tuple[Point, ...]] = field(default_factory=dict)
    loads: Mapping[str, tuple[Point, ...]] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    joints: Mapping[str, tuple[JointPoint, ...]] = field(default_factory=dict)

    @property
    def times(self) -> tuple[float, ...]:
        """Times [s] at which a rate of change may jump: 0, the times of all keyframes, and the duration; ascending."""
        times = {0.0, self.duration}
        for tracks in (self.keyframes, self.actuators, self.loads, self.joints):
            times.update(frame.time for frames in tracks.values() for frame in frames)
        return tuple(sorted(times))

    def moments(self, steps: int | None) -> list[float]:
        """Return the end times [s] of ``steps`` equal load steps; if it is None, the `times` after 0."""
        if steps is None:
            return list(self.times[1:])
        return list(np.linspace(0.0, self.duration, steps + 1)[1:])

    def handle_poses(self, time: float) -> dict[str, Pose]:
        """Return a dict from the name of each moving handle or obstacle to its pose at a time [s].

        The time is limited to 0 .. duration.
        """
        moment = min(max(time, 0.0), self.duration)
        return {name: _pose_at(frames, moment) for name, frames in self.keyframes.items()}

    def actuator_values(self, time: float) -> dict[str, float]:
        """Return a dict from the name of each actuator of the program to its command at a time [s].

        The time is limited to 0 .. duration.
        """
        moment = min(max(time, 0.0), self.duration)
        return {name: _value_at(points, moment, self.start[name]) for name, points in self.actuators.items()}

    def load_factors(self, time: float) -> dict[str, float]:
        """Return a dict from the name of each load of the program to its factor at a time [s].

        The time is limited to 0 .. duration.
        """
        moment = min(max(time, 0.0), self.duration)
        return {name: _value_at(points, moment, self.start[name]) for name, points in self.loads.items()}

    def joint_positions(self, time: float) -> dict[str, float]:
        """Return a dict from the name of each joint of the program to its position [rad] or [m] at a time [s].

        The time is limited to 0 .. duration.
        """
        moment = min(max(time, 0.0), self.duration)
        return {name: _joint_at(points, moment, self.start[name]) for name, points in self.joints.items()}


def _pose_at(frames: tuple[Keyframe, ...], time: float) -> Pose:
    if frames[0].time > 0.0:
        frames = (Keyframe(0.0, Pose()), *frames)
    last = bisect_right([frame.time for frame in frames], time) - 1
    if last == len(frames) - 1:
        return frames[last].pose
    start, end = frames[last], frames[last + 1]
    return start.pose.blend(end.pose, (time - start.time) / (end.time - start.time))


def _value_at(points: tuple[Point, ...], time: float, before: float) -> float:
    if points[0].time > 0.0:
        points = (Point(0.0, before), *points)
    last = bisect_right([point.time for point in points], time) - 1
    if last == len(points) - 1:
        return points[last].value
    start, end = points[last], points[last + 1]
    return start.value + (time - start.time) / (end.time - start.time) * (end.value - start.value)


def _joint_at(points: tuple[JointPoint, ...], time: float, before: float) -> float:
    if points[0].time > 0.0:
        points = (JointPoint(0.0, before), *points)
    values = np.array([[point.value] for point in points]), np.array([[point.velocity] for point in points])
    return float(spline([point.time for point in points], *values, at=time)[0])
