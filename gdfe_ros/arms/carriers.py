# SPDX-License-Identifier: Apache-2.0
"""All arms of a scene in a simulation: joint commands, joint motion, and joint efforts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.arms.arm import Arm
from gdfe_ros.arms.dynamics import LinkFrame, Push
from gdfe_ros.arms.joint_limits import JointMotion
from gdfe_ros.constraints.pose import Pose
from gdfe_ros.solver.contact.touch import Touch

Vector = NDArray[np.float64]
Motions = dict[str, JointMotion]
"""Dict from arm to the motion of its joints."""


class JointReading(NamedTuple):
    """State of a joint after a step.

    Attributes:
        goal: commanded position [rad] or [m].
        position: [rad] or [m].
        velocity: [rad/s] or [m/s].
        effort: torque [N m] or force [N] of the motor.
        limited: message about limits that restricted the motion, and about an effort above its limit; empty otherwise.
    """

    goal: float
    position: float
    velocity: float
    effort: float
    limited: str = ""


@dataclass(frozen=True, eq=False)
class ArmsStep:
    """Outcome of a step of all arms.

    Attributes:
        motions: motions of the joints after the step.
        poses: dict from each handle on an arm, and each obstacle of a link, to its pose.
        cuts: dict from joint to the limits that restricted its motion, e.g. ``velocity and acceleration``.
    """

    motions: Motions
    poses: dict[str, Pose]
    cuts: dict[str, str]


class Carriers:
    """The arms of a scene, advanced together in each step.

    Args:
        arms: arms of the scene.
    """

    def __init__(self, arms: Sequence[Arm]) -> None:
        self._arms = tuple(arms)
        self._places = {joint.name: (arm, i) for arm in arms for i, joint in enumerate(arm.joints)}

    def __bool__(self) -> bool:
        return bool(self._arms)

    def at_rest(self) -> Motions:
        """Return the initial motion of the joints: initial positions and no velocity."""
        return {arm.name: JointMotion.at(arm.start) for arm in self._arms}

    @staticmethod
    def restore(motions: Mapping[str, Sequence[Vector]]) -> Motions:
        """Return the motions of joints from a snapshot, in which they are tuples of arrays."""
        return {name: JointMotion(*parts) for name, parts in motions.items()}

    def parts(self, motions: Motions, part: str) -> dict[str, float]:
        """Return a dict from joint to one field of its `JointMotion`; ``part`` is the field, e.g. ``positions``."""
        return {name: float(getattr(motions[arm.name], part)[i]) for name, (arm, i) in self._places.items()}

    def frames(self, motions: Motions) -> dict[str, LinkFrame]:
        """Return a dict from link to its frame in the world."""
        found: dict[str, LinkFrame] = {}
        for arm in self._arms:
            found |= arm.dynamics.frames(motions[arm.name].positions)
        return found

    def advance(self, motions: Motions, goals: Mapping[str, float], dt: float, last: Mapping[str, Pose]) -> ArmsStep:
        """Return motions and poses of all arms after a step.

        Args:
            motions: motions of the joints before the step.
            goals: dict from joint to its new commanded position [rad] or [m]; other joints keep their last command.
            dt: duration of the step [s].
            last: poses of handles and of obstacles of links before the step.
        """
        found, poses, cuts = {}, {}, {}
        for arm in self._arms:
            before = motions[arm.name]
            pairs = zip(arm.joints, before.goals.tolist(), strict=True)
            wanted = np.array([goals.get(joint.name, goal) for joint, goal in pairs], dtype=np.float64)
            if before.arrived and np.array_equal(wanted, before.positions):
                found[arm.name] = before
                poses |= arm.keep_poses(before.positions, last)
                continue
            found[arm.name], cut = arm.limits.advance(before, wanted, dt)
            poses |= arm.poses(found[arm.name].positions, last)
            for i, joint in enumerate(arm.joints):
                kinds = [kind for kind, held in zip(cut._fields, cut, strict=True) if held[i]]
                if kinds:
                    cuts[joint.name] = " and ".join(kinds)
        return ArmsStep(found, poses, cuts)

    @staticmethod
    def part_way(before: Motions, after: Motions, fraction: float) -> Motions:
        """Return the motions at a ``fraction`` of a step; velocities and accelerations are those of the step."""
        if fraction == 1.0:
            return after
        return {
            name: now._replace(positions=before[name].positions + fraction * (now.positions - before[name].positions))
            for name, now in after.items()
        }

    @staticmethod
    def have_arrived(motions: Motions) -> bool:
        """Return whether all joints are at their commanded positions and do not move."""
        return all(motion.arrived for motion in motions.values())

    def readings(
        self,
        motions: Motions,
        poses: Mapping[str, Pose],
        reactions: Mapping[str, Vector],
        contacts: Mapping[str, Touch],
        gravity: Vector,
        cuts: Mapping[str, str],
    ) -> dict[str, JointReading]:
        """Return a dict from joint to its state.

        Args:
            motions: motions of the joints.
            poses: poses of handles and of obstacles of links.
            reactions: dict from handle or obstacle to its wrench on the soft body (6,) [N] and [N m].
            contacts: dict from contact to its points; only contacts of rigid bodies with links are used.
            gravity: acceleration (3,) [m/s^2].
            cuts: dict from joint to the limits that restricted its motion in the last step.
        """
        found = {}
        for arm in self._arms:
            motion = motions[arm.name]
            pushes = link_pushes(arm, poses, reactions, contacts)
            efforts = arm.dynamics.efforts(*motion[1:], gravity=gravity, pushes=pushes)
            for i, joint in enumerate(arm.joints):
                limited = [f"{cuts[joint.name]} cut to its limit"] if joint.name in cuts else []
                if abs(efforts[i]) > arm.limits.effort[i]:
                    limited.append(f"effort {efforts[i]:.4g} above its limit {arm.limits.effort[i]:g}")
                numbers = (motion.goals[i], motion.positions[i], motion.velocities[i], efforts[i])
                found[joint.name] = JointReading(*map(float, numbers), limited=", ".join(limited))
        return found


def link_pushes(
    arm: Arm, poses: Mapping[str, Pose], reactions: Mapping[str, Vector], contacts: Mapping[str, Touch]
) -> dict[str, Push]:
    """Return a dict from link to the wrench of soft and rigid bodies on it; moments are about the world's origin."""
    total: dict[str, Vector] = {}

    def add(link: str, force: Vector, moment: Vector, point: Vector) -> None:
        wrench = np.concatenate([force, moment + np.cross(point, force)])
        total[link] = total.get(link, np.zeros(6)) + wrench

    held = reactions.get(arm.handle)
    if held is not None:
        add(arm.flange, -held[:3], -held[3:], arm.centre + poses[arm.handle].translation)
    for piece in arm.links:
        if piece.name in reactions:
            wrench, origin = reactions[piece.name], np.add(piece.origin, poses[piece.name].translation)
            add(piece.link, -wrench[:3], -wrench[3:], origin)
        for name, touch in contacts.items():
            if name.endswith(f" on {piece.name}") and len(touch.forces):
                force = -touch.forces.sum(axis=0)
                add(piece.link, force, -np.cross(touch.places, touch.forces).sum(axis=0), np.zeros(3))
    return {link: Push(wrench[:3], wrench[3:], np.zeros(3)) for link, wrench in total.items()}
