# SPDX-License-Identifier: Apache-2.0
"""Commands to a simulation, and checks of commands, states and times against its scene."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.actuators import Actuator, Mode
from gdfe_ros.actuators.embedding import Embedding
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.errors import CommandError, RangeError, SceneError, require_named
from gdfe_ros.mesh.quality import list_ids
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.settings import SolverSettings
from gdfe_ros.solver.state import Snapshot
from gdfe_ros.untrusted.real_number import is_finite, is_number, require_command
from gdfe_ros.untrusted.spelling import did_you_mean

LARGEST_POSE = 1000.0
"""Limits of a commanded pose: largest translation [body lengths] and largest rotation [revolutions]."""
MOST_INFLATED = 1000.0
"""Largest commanded volume of a chamber, divided by its undeformed volume. At this limit its walls are ten times as
long and wide.
"""


@dataclass(frozen=True)
class Command:
    """Absolute targets of one step; items that are not named keep their last target.

    Attributes:
        handles: dict from handle to its pose relative to its rest pose.
        actuators: dict from actuator to its command in the unit of its mode, e.g. a tension [N]; for growth, 0 to 1.
        loads: dict from load to the factor on it; the factor is 1 before the first command.
        bodies: dict from rigid body, or soft body of ``soft_bodies``, to its pose relative to its rest pose. The body
            is teleported to this pose before the step, with zero velocity, and then moves freely again. A soft body
            keeps its deformation.
        joints: dict from joint of an arm to its position [rad] or [m]; the joint approaches it within its limits.
    """

    handles: Mapping[str, Pose] = field(default_factory=dict)
    actuators: Mapping[str, float] = field(default_factory=dict)
    loads: Mapping[str, float] = field(default_factory=dict)
    bodies: Mapping[str, Pose] = field(default_factory=dict)
    joints: Mapping[str, float] = field(default_factory=dict)


class Orders:
    """The commands that a scene accepts, and their limits.

    Args:
        scene: scene with the handles, actuators and loads.
        settings: settings of the solver.

    Attributes:
        text: scene file, policy and torsion, which together determine the equilibria.
        actuators, loads, joints: dict from name to actuator, load, or joint of an arm, in the scene's order.

    Raises:
        SceneError: a keyframe of the program is farther than `LARGEST_POSE`.
    """

    def __init__(self, scene: Scene, settings: SolverSettings) -> None:
        self._scene, self._own = scene, f" in scene {scene.name!r}"
        self.text = f"{scene.source}\npolicy {settings.policy.value}, torsion {settings.torsion.value}"
        self._handles = {handle.name: handle for handle in scene.handles}
        self.actuators = {actuator.name: actuator for actuator in scene.actuators}
        self.loads = {load.name: load for load in scene.loads}
        self.joints = {joint.name: joint for arm in scene.arms for joint in arm.joints}
        tracks = scene.program.keyframes.items() if scene.program else ()
        frames = [(name, frame) for name, track in tracks for frame in track]
        texts = [self._distance(f"program: {name!r} at {frame.time:g} s is", frame.pose) for name, frame in frames]
        if defects := [text for text in texts if text]:
            raise SceneError(f"scene {scene.name}", defects)

    def handle(self, name: str) -> Handle:
        """Return the handle of this name.

        Raises:
            CommandError: no such handle.
        """
        require_named("handle", name, self._handles, self._own)
        return self._handles[name]

    def actuator(self, name: str) -> Actuator:
        """Return the actuator of this name.

        Raises:
            CommandError: no such actuator.
        """
        require_named("actuator", name, self.actuators, self._own)
        return self.actuators[name]

    def probes(self, names: Sequence[str] | None) -> list[Embedding]:
        """Return the probes with these names; None: all probes.

        Raises:
            CommandError: no such probe.
        """
        known = self._scene.probes
        for name in names or ():
            require_named("probe", name, known)
        return [known[name] for name in (known if names is None else names)]

    def targets(self, command: Command | None, last: Mapping[str, Pose]) -> dict[str, Pose]:
        """Return a dict from handle to its target after a command, given the ``last`` targets.

        Raises:
            CommandError: the argument is not a `Command`. Or a handle is unknown, fixed, carried by an arm, or a rigid
                body, or its target is farther than `LARGEST_POSE`.
        """
        if command is not None and not isinstance(command, Command):
            raise CommandError(f"a step follows a Command, or None; got {command!r}")
        for name, given in vars(command or Command()).items():
            if not isinstance(given, Mapping):
                raise CommandError(f"{name} of a Command are a mapping by name; got {given!r}")
        targets = dict(last)
        for name, pose in (command.handles if command else {}).items():
            _require_pose(f"handle {name!r}: the target", pose)
            require_movable(handle := self.handle(name))
            self._require_near(f"{handle.noun} {name!r} is commanded", pose)
            targets[name] = pose
        return targets

    def places(self, command: Command | None) -> dict[str, Pose]:
        """Return a dict from free body, rigid or soft, to the pose to which a command teleports it.

        Raises:
            CommandError: a body is unknown, or its pose is not a `Pose` or is farther than `LARGEST_POSE`.
        """
        places = dict(command.bodies if command else {})
        known = [*(body.name for body in self._scene.rigid_bodies), *self._scene.soft_bodies]
        for name, pose in places.items():
            if name not in known:
                raise CommandError(f"no free body {name!r}{self._own}; bodies: {', '.join(known) or 'none'}")
            _require_pose(f"body {name!r}: the pose", pose)
            self._require_near(f"body {name!r} is put", pose)
        return places

    def require_own(self, snapshot: Snapshot) -> None:
        """Check that a snapshot belongs to this scene: in another scene, the same positions have other forces.

        Raises:
            CommandError: the scene's text (materials, dynamics or anything else), the policy or the torsion differs.
        """
        if snapshot.scene != self.text:
            raise CommandError(
                f"the snapshot is one of another scene than {self._scene.name!r}, or of a scene with another text, "
                "policy or torsion; remedy: restore it in the simulation that took it, or start from its shape with "
                "set_positions"
            )

    def _require_near(self, what: str, pose: Pose) -> None:
        if text := self._distance(what, pose):
            raise CommandError(text)

    def _distance(self, what: str, pose: Pose) -> str:
        """Return a message about a pose that is too far from the rest pose; empty if it is near enough."""
        far = math.hypot(*pose.translation) / self._scene.mesh.size
        turns = math.hypot(*pose.rotation) / (2.0 * math.pi)
        if far <= LARGEST_POSE and turns <= LARGEST_POSE:
            return ""
        return (
            f"{what} {far:.3g} body lengths and {turns:.3g} turns away; at most {LARGEST_POSE:g} of each are allowed; "
            "remedy: check the units (metres, radians)"
        )

    def values(self, command: Command | None, last: Mapping[str, float]) -> dict[str, float]:
        """Return a dict from actuator or load to its target value after a command, given the ``last`` values.

        Raises:
            CommandError: an actuator or load is unknown, or its command is out of range.
        """
        values = dict(last)
        for name, value in (command.actuators if command else {}).items():
            grips = self.actuator(name).mode is Mode.GRIP
            values[name] = float(self.require(name, value) >= 0.5) if grips else self.require(name, value)
        for name, value in (command.loads if command else {}).items():
            require_named("load", name, self.loads, self._own)
            values[name] = self.require(name, value)
        return values

    def positions(self, command: Command | None) -> dict[str, float]:
        """Return a dict from joint to its commanded position [rad] or [m].

        Raises:
            CommandError: there is no such joint, or a position is not a finite number within the joint's limits.
        """
        given = dict(command.joints if command else {})
        for name in given:
            if name not in self.joints:
                joints = ", ".join(self.joints) or "none"
                raise CommandError(f"no joint {name!r}; {did_you_mean(name, self.joints)}joints: {joints}")
        return {name: self.require(name, value) for name, value in given.items()}

    def require(self, name: str, value: object) -> float:
        """Return a command of an actuator, a load (its factor) or a joint (its position), after a check.

        Raises:
            CommandError: it is no finite number.
            RangeError: it is out of range.
        """
        if name in self.loads:
            return require_command(f"load {name!r}: factor", value)
        if name in self.joints:
            return self.joints[name].require(value)
        number = self.actuators[name].require(value)
        self._require_room(self.actuators[name], number)
        return number

    def limits(self, name: str) -> tuple[float, float]:
        """Return the least and the largest command of an actuator, a load (its factor) or a joint (its position)."""
        if name in self.loads:
            return -math.inf, math.inf
        if name in self.joints:
            return self.joints[name].limits.lower, self.joints[name].limits.upper
        actuator = self.actuators[name]
        return actuator.low, min(actuator.high, MOST_INFLATED * self._room(actuator))

    def _room(self, actuator: Actuator) -> float:
        """Return the undeformed volume [m^3] of a chamber whose volume is commanded; infinite for other actuators."""
        if actuator.mode is not Mode.VOLUME:
            return math.inf
        return max(actuator.volume(self._scene.mesh.vertices), actuator.least)

    def _require_room(self, actuator: Actuator, value: float) -> None:
        """Raise RangeError for a chamber's volume above `MOST_INFLATED` times its undeformed volume."""
        rest = self._room(actuator)
        if value > MOST_INFLATED * rest:
            raise RangeError(
                f"actuator {actuator.name!r}: volume {value!r} m^3 is {value / rest:.3g} times the undeformed one, "
                f"{rest:.3g} m^3; at most {MOST_INFLATED:g} times are allowed; remedy: check the unit: 1 ml is 1e-6 m^3"
            )

    def within_rates(self, values: Mapping[str, float], present: Mapping[str, float], dt: float) -> dict[str, float]:
        """Return ``values``, limited to changes from ``present`` that the actuators' rates allow in ``dt`` [s]."""
        limited = dict(values)
        for name, actuator in self.actuators.items():
            if np.isfinite(actuator.rate):
                reach = actuator.rate * dt
                limited[name] = float(np.clip(limited[name], present[name] - reach, present[name] + reach))
        return limited


def require_movable(handle: Handle) -> None:
    """Check that a handle or obstacle follows commanded poses.

    Raises:
        CommandError: an arm carries it, it moves freely, or it is fixed.
    """
    what = f"{handle.noun} {handle.name!r}"
    if arm := handle.carrier or getattr(handle, "arm", ""):
        text = f"{what} is carried by arm {arm!r}; remedy: command the arm's joints"
    elif handle.section == "bodies":
        text = f"{what} moves freely and follows no target; remedy: teleport it, or make it an obstacle"
    elif handle.fixed:
        entry = f"{handle.section}.{handle.name}.fixed=false"
        remedy = f"put {entry} into scene_overrides of a node, or into overrides of load_scene"
        text = f"{what} is fixed in the scene and takes no commands; remedy: {remedy}"
    else:
        return
    raise CommandError(text)


def require_snapshot(given: object) -> None:
    """Check that the argument is a snapshot.

    Raises:
        CommandError: the argument is something else.
    """
    if not isinstance(given, Snapshot):
        raise CommandError(f"a snapshot is what Simulation.snapshot returned; got {given!r}")


def check_positions(positions: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return a checked copy of given positions [m].

    Raises:
        CommandError: the positions have another shape, or a value is not finite.
    """
    try:
        given = np.array(positions, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise CommandError(f"positions are no array of numbers: {error}") from error
    if given.shape != shape:
        raise CommandError(f"positions have the shape {given.shape}; allowed: {shape}, one row for each vertex")
    wrong = np.flatnonzero(~np.isfinite(given).all(axis=1))
    if len(wrong):
        raise CommandError(f"positions of vertices {list_ids(wrong)} are not finite; allowed: finite [m]")
    return given


def _require_pose(what: str, pose: object) -> None:
    if not isinstance(pose, Pose):
        raise CommandError(f"{what} is {pose!r}; allowed: a Pose(translation, rotation)")


LONGEST = 1e9
"""Longest duration of a step and longest deadline [s]."""
MOST_STEPS = 100_000
"""Largest number of internal steps into which one step of a body with mass may be divided."""


def require_times(*, dt: object, deadline: object, cut_after: object) -> float:
    """Check the duration ``dt`` [s] of a step, and its limits ``deadline`` [s] and ``cut_after``; None means no limit.

    Returns:
        ``dt`` in double precision. In lower precision, the sum of many time steps stops growing.

    Raises:
        CommandError: a time is not finite, below zero or above `LONGEST`, or ``cut_after`` is negative or not a whole
            number.
    """
    for name, value in (("dt", dt), ("deadline", 0.0 if deadline is None else deadline)):
        if not (is_number(value) and is_finite(value) and 0.0 <= value <= LONGEST):
            raise CommandError(f"{name} is {value!r}; allowed: finite, 0 to {LONGEST:g} [s]")
    if cut_after is not None and not (is_number(cut_after, numbers.Integral) and cut_after >= 0):
        raise CommandError(f"cut_after is {cut_after!r}; allowed: whole numbers, 0 or more")
    return float(dt)


def require_countable(*, dt: float, step: float) -> None:
    """Check that ``dt`` [s] has at most `MOST_STEPS` internal steps of ``step`` [s].

    Raises:
        CommandError: ``dt`` has more internal steps.
    """
    if dt > MOST_STEPS * step:
        raise CommandError(
            f"dt is {dt!r}, {dt / step:.3g} internal steps of {step:g} s (dynamics.step); allowed: 0 to "
            f"{MOST_STEPS * step:g} s, {MOST_STEPS} internal steps; remedy: make several steps"
        )
