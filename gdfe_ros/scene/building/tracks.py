# SPDX-License-Identifier: Apache-2.0
"""Construction of the program from the valid parts of a scene file, and checks of its tracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from gdfe_ros.arms.description import Joint
from gdfe_ros.arms.spline import find_excess
from gdfe_ros.scene.building.actuators import neutral_commands
from gdfe_ros.scene.building.arms import ONE, joint_starts
from gdfe_ros.scene.document import KeyPath
from gdfe_ros.scene.program import JointPoint, Keyframe, Point, Program
from gdfe_ros.scene.report import NO_VALUE, Defects, suggest
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.schemas.obstacle_schema import ObstacleModel
from gdfe_ros.scene.schemas.scene_schema import Draft, HandleModel

Frame = Keyframe | Point | JointPoint
_TRACKS = {
    "handles": ("keyframe", "[{time: 1.0, translation: [0, 0, 0.1]}]"),
    "obstacles": ("keyframe", "[{time: 1.0, translation: [0, 0, 0.1]}]"),
    "actuators": ("keyframe", "[{time: 1.0, value: 1.0}]"),
    "loads": ("keyframe", "[{time: 1.0, value: 1.0}]"),
    "joints": ("point", "[{time: 1.0, value: 0.5}]"),
}
"""Dict from each section of a program to the noun of its entries, and to an example."""


def build_program(draft: Draft, scene: Scene, report: Defects) -> Program:
    """Return the program; report unknown or immovable items, and times that do not ascend or exceed the duration.

    Args:
        draft: valid parts of the file.
        scene: the scene without its program.
        report: collects the defects.
    """
    model = draft.program
    for section in _TRACKS:
        _require_tracks(section, draft, scene, report)
    for actuator in scene.actuators:
        path, text = ("program", "actuators", actuator.name), "the actuator's range"
        _require_between(model.actuators, "value", (actuator.low, actuator.high), path, text, report)
    for joint in (joint for arm in scene.arms for joint in arm.joints):
        path, limits, fast = ("program", "joints", joint.name), joint.limits, joint.limits.velocity
        _require_between(model.joints, "value", (limits.lower, limits.upper), path, "the joint's limits", report)
        _require_between(model.joints, "velocity", (-fast, fast), path, "the joint's limit", report)
        _require_within(model.joints.get(joint.name, ()), joint_starts(scene.arms)[joint.name], joint, path, report)
    return model.starting_from(neutral_commands(scene) | joint_starts(scene.arms))


def _require_tracks(section: str, draft: Draft, scene: Scene, report: Defects) -> None:
    """Report the tracks of a section that are empty, out of order, too late, or of unknown or immovable items."""
    noun, example = _TRACKS[section]
    names, complete = report.names(section), True
    if section == "joints":
        count = len(report.names("arms")) + (report.value_at((ONE,), plain=False) is not NO_VALUE)
        names, complete = [joint.name for arm in scene.arms for joint in arm.joints], len(scene.arms) == count
    known = getattr(draft, section) if section in ("handles", "obstacles") else {}
    carriers = {arm.handle: arm.name for arm in scene.arms} if section == "handles" else {}
    for name, frames in getattr(draft.program, section).items():
        path = ("program", section, name)
        if complete and name not in names:
            report.refuse(path, f"there is no such {section[:-1]}{suggest(name, names)}")
        if name in known:
            _require_movable(known[name], frames, path, report)
        if name in carriers:
            text = f"arm {carriers[name]!r} carries this handle; remedy: program.joints, positions of its joints"
            report.refuse(path, text)
        if not frames:
            report.add(path, f"there is no {noun}; give e.g. {example}")
        _require_times(frames, draft.program.duration, path, report)


def _require_times(frames: Sequence[Frame], duration: float, path: KeyPath, report: Defects) -> None:
    """Report times beyond the duration, and times that do not ascend."""
    for i, frame in enumerate(frames):
        if frame.time > duration:
            report.add((*path, i, "time"), f"allowed are times up to the duration, {duration:g} s")
        if i and frame.time <= frames[i - 1].time:
            report.add((*path, i, "time"), f"times must ascend; the one before is {frames[i - 1].time:g} s")


def _require_between(
    tracks: Mapping[str, Sequence[Frame]],
    key: str,
    bounds: tuple[float, float],
    path: KeyPath,
    limit: str,
    report: Defects,
) -> None:
    """Report the points of one track whose value ``key`` is out of bounds; ``limit`` names the bounds in messages."""
    low, high = bounds
    for i, point in enumerate(tracks.get(path[-1], ())):
        if not low <= getattr(point, key) <= high:
            report.add((*path, i, key), f"allowed by {limit}: {low:g} to {high:g}")


def _require_within(points: Sequence[JointPoint], start: float, joint: Joint, path: KeyPath, report: Defects) -> None:
    """Report a joint whose cubics leave its limits between its points, which follow ``start`` at time 0."""
    rows = [(point.time, point.value, point.velocity) for point in points]
    if not rows or any(after.time <= before.time for before, after in pairwise(points)):
        return  # another defect, or no motion
    times, values, slopes = np.array([(0.0, start, 0.0), *rows] if rows[0][0] > 0.0 else rows).T
    low, high = joint.limits.lower, joint.limits.upper
    found = find_excess(times, values[:, None], slopes[:, None], low=np.array([low]), high=np.array([high]))
    if found is not None:
        text = f"{found[2]:.6g} {joint.unit} at {found[1]:.6g} s, between two points; allowed by the joint's limits: "
        report.add(path, f"the joint reaches {text}{low:g} to {high:g}; remedy: smaller velocities, or more points")


def _require_movable(
    item: HandleModel | ObstacleModel, frames: Sequence[Keyframe], path: KeyPath, report: Defects
) -> None:
    """Report keyframes of a fixed item, and keyframes that move an item along or about one of its free axes."""
    if item.fixed:
        report.refuse(path, f"this {path[1][:-1]} is fixed; remedy: remove `fixed: true` or this entry")
    for i, frame in enumerate(frames if isinstance(item, HandleModel) else ()):
        for key, axes, head in (("translation", item.axes, ""), ("rotation_deg", item.turning, "r")):
            for letter in (f"{head}{axis.name.lower()}" for axis in axes if getattr(frame, key)[axis]):
                text = f"{letter} is free and cannot be commanded; use 0 for {letter}"
                report.add((*path, i, key), text)
