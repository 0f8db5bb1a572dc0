# SPDX-License-Identifier: Apache-2.0
"""An arm in a scene: its joints carry a handle of the soft body, and its links are obstacles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.arms.description import Joint
from gdfe_ros.arms.dynamics import LinkDynamics, LinkFrame
from gdfe_ros.arms.limits import JointLimits
from gdfe_ros.constraints.arm_link import ArmLink
from gdfe_ros.constraints.pose import Pose
from gdfe_ros.constraints.turn import nearest_turn, quaternion_of

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Visual:
    """A drawn shape of a link.

    Attributes:
        link: name of its link.
        faces: (f, k, 3) [m] its faces in the link's frame.
        colour: red, green, blue, from 0 to 1; None if the description states none.
    """

    link: str
    faces: Vector
    colour: tuple[float, float, float] | None


@dataclass(frozen=True, eq=False, kw_only=True)
class Arm:
    """An arm that carries a handle.

    The handle keeps its rest pose relative to the flange. With the flange at (p, R), initially (p0, R0), a handle with
    the rest centre c has the pose

        rotation R R0^T, translation p + R R0^T (c - p0) - c.

    Attributes:
        name: of the arm.
        dynamics: kinematics and dynamics of its links.
        flange: name of the link that carries the handle.
        handle: name of the handle.
        centre: (3,) [m] centre of the handle in its rest pose.
        start: (n,) initial positions of its commanded joints [rad] or [m].
        links: pieces of its links that touch.
        visuals: drawn shapes of its links.
    """

    name: str
    dynamics: LinkDynamics
    flange: str
    handle: str
    centre: Vector
    start: Vector
    links: tuple[ArmLink, ...] = ()
    visuals: tuple[Visual, ...] = ()

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Its commanded joints."""
        return self.dynamics.joints

    @property
    def text(self) -> str:
        """Its URDF, with the prefix."""
        return self.dynamics.description.text

    @cached_property
    def limits(self) -> JointLimits:
        """Limits of its commanded joints."""
        return JointLimits([joint.limits for joint in self.joints])

    @cached_property
    def rest(self) -> dict[str, LinkFrame]:
        """Initial frame of each link."""
        return self.dynamics.frames(self.start)

    def poses(self, q: Vector, last: Mapping[str, Pose]) -> dict[str, Pose]:
        """Return the poses of its handle and of its touching links, relative to rest.

        Args:
            q: positions of the joints (n,) [rad] or [m].
            last: previous poses, whose rotation vectors are continued beyond 180 degrees.
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

    def placed(self, q: Vector) -> Iterator[tuple[Joint, float]]:
        """Return each commanded joint with its position in ``q`` (n,)."""
        return zip(self.joints, q.tolist(), strict=True)

    def known_poses(self, q: Vector, last: Mapping[str, Pose]) -> dict[str, Pose]:
        """Return the ``last`` poses of an arm that has not moved since; if some are unknown, those of `poses`."""
        names = [name for name, *_ in self._carried]
        return {name: last[name] for name in names} if all(name in last for name in names) else self.poses(q, last)

    @cached_property
    def _carried(self) -> list[tuple[str, str, Vector, bool]]:
        """Name, link and rest centre of the handle and of each piece; also whether its link is immovable."""
        mounted = self.dynamics.description.rigid_with(self.dynamics.description.root)
        pieces = [(piece.name, piece.link, np.array(piece.origin), piece.link in mounted) for piece in self.links]
        return [(self.handle, self.flange, self.centre, False), *pieces]


def _whole_turns(last: Pose | None) -> tuple[float, float, float]:
    """Return the rotation vector of whole turns nearest to the ``last`` pose's rotation; zero without a last pose."""
    return (0.0, 0.0, 0.0) if last is None else nearest_turn((0.0, 0.0, 0.0, 1.0), last)
