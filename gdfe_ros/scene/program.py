# SPDX-License-Identifier: Apache-2.0
"""A program: poses of handles, commands of actuators and loads, and positions of joints over time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, TypeVar

import numpy as np
from pydantic import Field, PrivateAttr

from gdfe_ros.arms.spline import spline
from gdfe_ros.constraints import Pose
from gdfe_ros.quantity import Quantity, Vector
from gdfe_ros.scene.base_entry import Entry

TIME = Quantity("time", "s", least=0.0, most=1e6)


_TRANSLATION = Quantity("translation [x, y, z]", "m", least=-1e3, most=1e3, count=3)
_ROTATION = Quantity("rotation vector [x, y, z]", "degrees", least=-36000, most=36000, count=3)


class Keyframe(Entry):
    """The pose of a handle or obstacle at a time, relative to its rest pose; a key that is left out is zero."""

    time: Annotated[float, TIME]
    translation: Annotated[Vector, _TRANSLATION] = (0.0, 0.0, 0.0)
    rotation_deg: Annotated[Vector, _ROTATION] = (0.0, 0.0, 0.0)

    @cached_property
    def pose(self) -> Pose:
        """The pose in SI units."""
        return Pose(self.translation, tuple(np.radians(self.rotation_deg).tolist()))


class Point(Entry):
    """The command of an actuator, or the factor of a load, at a time."""

    time: Annotated[float, TIME]
    value: Annotated[float, Quantity("command in the actuator's unit, or factor of the load", least=-1e15, most=1e15)]


class JointPoint(Entry):
    """Position and velocity of an arm's joint at a time; between two points the position is a cubic polynomial."""

    time: Annotated[float, TIME]
    value: Annotated[float, Quantity("position of the joint, in rad or m", least=-1e6, most=1e6)]
    velocity: Annotated[float, Quantity("velocity of the joint there, in rad/s or m/s", least=-1e6, most=1e6)] = 0.0


Frame = TypeVar("Frame", Keyframe, Point)


class Program(Entry):
    """Commands over time, which `gdfe solve` plays.

    At time 0 a handle is in its rest pose, unless it has a keyframe at time 0. Between two keyframes its pose changes
    linearly. After the last keyframe it keeps its last pose. The same holds for the commands of actuators and loads,
    which start at the values of `starting_from`. Between two points of a joint its position is a cubic polynomial.
    """

    duration: Annotated[float, Quantity("duration", "s", above=0.0, most=1e6)]
    handles: dict[str, tuple[Keyframe, ...]] = Field({}, description="keyframes of each moving handle")
    obstacles: dict[str, tuple[Keyframe, ...]] = Field({}, description="keyframes of each moving obstacle")
    actuators: dict[str, tuple[Point, ...]] = Field({}, description="commands {time, value} of each actuator")
    loads: dict[str, tuple[Point, ...]] = Field({}, description="factors {time, value} of each load")
    joints: dict[str, tuple[JointPoint, ...]] = Field(
        {}, description="positions {time, value, velocity} of each joint of an arm"
    )
    _start: dict[str, float] = PrivateAttr(default_factory=dict)

    def starting_from(self, commands: Mapping[str, float]) -> Program:
        """Return the program with these values of actuators, loads and joints at time 0, before their first points."""
        program = self.model_copy()
        program._start = {name: commands.get(name, 0.0) for name in (*self.actuators, *self.loads, *self.joints)}
        return program

    @property
    def keyframes(self) -> dict[str, tuple[Keyframe, ...]]:
        """Dict from the name of each handle and obstacle to its keyframes."""
        return {**self.handles, **self.obstacles}

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
        """Return a dict from each handle and obstacle to its pose at a time [s], limited to 0 .. duration."""
        moment = self._within(time)
        return {name: _pose_at(frames, moment) for name, frames in self.keyframes.items()}

    def actuator_values(self, time: float) -> dict[str, float]:
        """Return a dict from each actuator to its command at a time [s], limited to 0 .. duration."""
        return self._values(self.actuators, time)

    def load_factors(self, time: float) -> dict[str, float]:
        """Return a dict from each load to its factor at a time [s], limited to 0 .. duration."""
        return self._values(self.loads, time)

    def joint_positions(self, time: float) -> dict[str, float]:
        """Return a dict from each joint to its position [rad] or [m] at a time [s], limited to 0 .. duration."""
        moment = self._within(time)
        return {name: _joint_at(points, moment, self._start[name]) for name, points in self.joints.items()}

    def _values(self, tracks: Mapping[str, tuple[Point, ...]], time: float) -> dict[str, float]:
        moment = self._within(time)
        return {name: _value_at(points, moment, self._start[name]) for name, points in tracks.items()}

    def _within(self, time: float) -> float:
        """Return a time [s] limited to 0 .. duration."""
        return min(max(time, 0.0), self.duration)


def _around(frames: Sequence[Frame], time: float) -> tuple[Frame, Frame, float]:
    """Return the frames before and after a time [s], and the elapsed fraction of the time between them."""
    last = bisect_right([frame.time for frame in frames], time) - 1
    start, end = frames[last], frames[min(last + 1, len(frames) - 1)]
    return start, end, 0.0 if start is end else (time - start.time) / (end.time - start.time)


def _pose_at(frames: tuple[Keyframe, ...], time: float) -> Pose:
    start, end, share = _around(frames if frames[0].time <= 0.0 else (Keyframe(time=0.0), *frames), time)
    return start.pose.blend(end.pose, share)


def _value_at(points: tuple[Point, ...], time: float, before: float) -> float:
    first = () if points[0].time <= 0.0 else (Point.model_construct(time=0.0, value=before),)
    start, end, share = _around((*first, *points), time)
    return start.value + share * (end.value - start.value)


def _joint_at(points: tuple[JointPoint, ...], time: float, before: float) -> float:
    if points[0].time > 0.0:
        points = (JointPoint.model_construct(time=0.0, value=before, velocity=0.0), *points)
    values = np.array([[point.value] for point in points]), np.array([[point.velocity] for point in points])
    return float(spline([point.time for point in points], *values, at=time)[0])
