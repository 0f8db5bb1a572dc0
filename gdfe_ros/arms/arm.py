# SPDX-License-Identifier: Apache-2.0
"""An arm in a scene: its joints carry a handle of the soft body, and its links are obstacles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.description import Joint
from gdfe_ros.arms.dynamics import Frame, LinkDynamics
from gdfe_ros.arms.limits import JointLimits
from gdfe_ros.constraints.arm_link import ArmLink
from gdfe_ros.constraints.pose import Pose
from gdfe_ros.constraints.turn import nearest_turn

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

    The handle keeps the place relative to the flange that it has at rest. With the flange at (p, R), at rest (p0, R0),
    a handle with the rest centre c has the pose

        rotation R R0^T, translation p + R R0^T (c - p0) - c.

    Attributes:
        name: of the arm.
        dynamics: kinematics and dynamics of its links.
        flange: name of the link that carries the handle.
        handle: name of the handle.
        centre: (3,) [m] of the handle at rest.
        start: (n,) positions of its commanded joints at rest [rad] or [m].
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
    def rest(self) -> dict[str, Frame]:
        """Frame of each link at rest."""
        return self.dynamics.frames(self.start)

    def poses(self, q: Vector, last: Mapping[str, Pose]) -> dict[str, Pose]:
        """Return the poses of its handle and of its touching links, relative to rest.

        Args:
            q: positions of the joints (n,) [rad] or [m].
            last: their poses before, whose rotations are continued beyond 180 degrees.
        """
        frames = self.dynamics.frames(q)
        carried = [(self.handle, self.flange, self.centre)]
        carried += [(piece.name, piece.link, np.array(piece.origin)) for piece in self.links]
        found = {}
        for name, link, centre in carried:
            rest, now = self.rest[link], frames[link]
            if np.array_equal(rest.origin, now.origin) and np.array_equal(rest.axes, now.axes):
                turn, shift = np.eye(3), np.zeros(3)
            else:
                turn = now.axes @ rest.axes.T
                shift = now.origin + turn @ (centre - rest.origin) - centre
            rotation = nearest_turn(Rotation.from_matrix(turn).as_quat(), last.get(name, Pose()))
            found[name] = Pose(tuple(shift.tolist()), rotation)
        return found
