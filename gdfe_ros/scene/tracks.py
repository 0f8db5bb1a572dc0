# SPDX-License-Identifier: Apache-2.0
"""Construction of the program from the valid parts of a scene file, and checks of its tracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gdfe_ros.scene.actuation import neutral_commands
from gdfe_ros.scene.arms import ONE, joint_starts
from gdfe_ros.scene.document import KeyPath
from gdfe_ros.scene.obstacle_schema import ObstacleModel
from gdfe_ros.scene.program import JointPoint, Keyframe, Point, Program
from gdfe_ros.scene.report import NO_VALUE, Defects, suggest
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.schema import Draft, HandleModel

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
    model, carriers = draft.program, {arm.handle: arm.name for arm in scene.arms}
    joints = {joint.name: joint.limits for arm in scene.arms for joint in arm.joints}
    count = len(report.names("arms")) + (report.value_at((ONE,), plain=False) is not NO_VALUE)
    for section, (noun, example) in _TRACKS.items():
        names = joints if section == "joints" else report.names(section)
        complete = section != "joints" or len(scene.arms) == count
        for name, frames in getattr(model, section).items():
            path = ("program", section, name)
            if complete and name not in names:
                report.refuse(path, f"there is no such {section[:-1]}{suggest(name, names)}")
            if section in ("handles", "obstacles") and name in (known := getattr(draft, section)):
                _require_movable(known[name], frames, path, report)
            if section == "handles" and name in carriers:
                text = f"arm {carriers[name]!r} carries this handle; remedy: program.joints, positions of its joints"
                report.refuse(path, text)
            if not frames:
                report.add(path, f"there is no {noun}; give e.g. {example}")
            _require_times(frames, model.duration, path, report)
    for actuator in scene.actuators:
        path, text = ("program", "actuators", actuator.name), "the actuator's range"
        _require_between(model.actuators, "value", (actuator.low, actuator.high), path, text, report)
    for name, limits in joints.items():
        path, fast = ("program", "joints", name), limits.velocity
        _require_between(model.joints, "value", (limits.lower, limits.upper), path, "the joint's limits", report)
        _require_between(model.joints, "velocity", (-fast, fast), path, "the joint's limit", report)
    start = neutral_commands(scene) | joint_starts(scene.arms)
    own = {name: start.get(name, 0.0) for name in (*model.actuators, *model.loads, *model.joints)}
    keyframes = {**model.handles, **model.obstacles}
    return Program(model.duration, keyframes, dict(model.actuators), dict(model.loads), own, dict(model.joints))


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
    """Report the numbers ``key`` of the points of one track that are out of bounds."""
    low, high = bounds
    for i, point in enumerate(tracks.get(path[-1], ())):
        if not low <= getattr(point, key) <= high:
            report.add((*path, i, key), f"allowed by {limit}: {low:g} to {high:g}")


def _require_movable(
    item: HandleModel | ObstacleModel, frames: Sequence[Keyframe], path: KeyPath, report: Defects
) -> None:
    """Report keyframes of an item that is fixed, or that move it along or about its free axes."""
    if item.fixed:
        report.refuse(path, f"this {path[1][:-1]} is fixed; remedy: remove `fixed: true` or this entry")
    for i, frame in enumerate(frames if isinstance(item, HandleModel) else ()):
        for key, axes, head in (("translation", item.axes, ""), ("rotation_deg", item.turning, "r")):
            for letter in (f"{head}{axis.name.lower()}" for axis in axes if getattr(frame, key)[axis]):
                text = f"{letter} is free and cannot be commanded; use 0 for {letter}"
                report.add((*path, i, key), text)
