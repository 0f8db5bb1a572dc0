# SPDX-License-Identifier: Apache-2.0
"""An arm in a scene: its joints carry a handle of the soft body, and its links are obstacles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.arms.description import Joint
from gdfe_ros.arms.dynamics import LinkDynamics, LinkFrame
from gdfe_ros.arms.joint_limits import JointLimits, JointSprings
from gdfe_ros.constraints.obstacle import ArmLink
from gdfe_ros.constraints.pose import Pose, nearest_turn, quaternion_of

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Visual:
    """A drawn shape of a link.

    Attributes:
        link: name of the link.
        faces: faces of the shape (f, k, 3) [m], in the link's frame.
        colour: red, green, blue, from 0 to 1; None if the description states none.
    """

    link: str
    faces: Vector
    colour: tuple[float, float, float] | None


@dataclass(frozen=True, eq=False, kw_only=True)
class Arm:
    """An arm that carries a handle.

    The handle is fixed to the flange. Let p be the flange's position and R its rotation, with the initial values p0 and
    R0, and let c be the handle's initial centre. The handle's pose is

        rotation R R0^T, translation p + R R0^T (c - p0) - c.

    Attributes:
        name: name of the arm.
        dynamics: kinematics and dynamics of the arm's links.
        flange: name of the link that carries the handle.
        handle: name of the handle.
        centre: centre of the handle in its rest pose (3,) [m].
        start: initial positions of the arm's commanded joints (n,) [rad] or [m].
        springs: springs of the joints that yield under load; None if all joints are rigid.
        links: obstacles with the shapes of the links that can touch the body.
        visuals: drawn shapes of the arm's links.
        remarks: messages about meshes that are left out of pictures.
    """

    name: str
    dynamics: LinkDynamics
    flange: str
    handle: str
    centre: Vector
    start: Vector
    springs: JointSprings | None = None
    links: tuple[ArmLink, ...] = ()
    visuals: tuple[Visual, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Commanded joints of the arm."""
        return self.dynamics.joints

    @property
    def text(self) -> str:
        """URDF of the arm, with the prefix on the names of links and joints."""
        return self.dynamics.description.text

    @cached_property
    def limits(self) -> JointLimits:
        """Limits of the arm's commanded joints."""
        return JointLimits([joint.limits for joint in self.joints])

    @cached_property
    def rest(self) -> dict[str, LinkFrame]:
        """Dict from link to its initial frame."""
        return self.dynamics.frames(self.start)

    def poses(self, q: Vector, last: Mapping[str, Pose]) -> dict[str, Pose]:
        """Return a dict from the handle and each obstacle in ``links`` to its pose, relative to its initial pose.

        Args:
            q: positions of the joints (n,) [rad] or [m].
            last: previous poses. Rotation vectors continue from them without jumps, also beyond 180 degrees.
        """
        if np.array_equal(q, self.start):
            return {name: Pose(rotation=_whole_turns(last.get(name))) for name, *_ in self._carried}
        frames, found = self.dynamics.frames(q), {}
        for name, link, centre, mounted in self._carried:
            if mounted:
                found[name] = Pose()
                continue
            rest, now = self.rest[link], frames[link]
            turn = now.axes @ rest.axes.T
            shift = now.origin + turn @ (centre - rest.origin) - centre
            rotation = nearest_turn(quaternion_of(turn.tolist()), last.get(name, Pose()))
            found[name] = Pose(tuple(shift.tolist()), rotation)
        return found

    def keep_poses(self, q: Vector, last: Mapping[str, Pose]) -> dict[str, Pose]:
        """Return the ``last`` poses of an arm that has not moved; if a pose is missing, compute them with `poses`."""
        names = [name for name, *_ in self._carried]
        return {name: last[name] for name in names} if all(name in last for name in names) else self.poses(q, last)

    @cached_property
    def _carried(self) -> list[tuple[str, str, Vector, bool]]:
        """Name, link and initial centre [m] of the handle and each obstacle, and whether its link is immovable."""
        mounted = self.dynamics.description.rigid_with(self.dynamics.description.root)
        pieces = [(piece.name, piece.link, np.array(piece.origin), piece.link in mounted) for piece in self.links]
        return [(self.handle, self.flange, self.centre, False), *pieces]

    def flange_distance(self, one: Vector, other: Vector, size: float) -> float:
        """Return how far [m] the flange, with a body of ``size`` [m] on it, moves at most between two joint positions.

        ``one`` and ``other`` are the joint positions (n,).
        """
        first, second = (self.dynamics.frames(q)[self.flange] for q in (one, other))
        turn = np.linalg.norm(second.axes - first.axes) / np.sqrt(2.0)
        return float(np.linalg.norm(second.origin - first.origin) + turn * size)


def _whole_turns(last: Pose | None) -> tuple[float, float, float]:
    """Return the rotation vector [rad] of zero or more full turns that is nearest to the rotation of the ``last`` pose.

    It is zero without a last pose. Zeros have a positive sign, so that a replay finds bitwise equal messages.
    """
    x, y, z = (0.0, 0.0, 0.0) if last is None else nearest_turn((0.0, 0.0, 0.0, 1.0), last)
    return x + 0.0, y + 0.0, z + 0.0
