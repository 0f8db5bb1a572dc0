# SPDX-License-Identifier: Apache-2.0
"""The description of a robot: its links, joints and shapes, as a URDF states them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray


class GeometryKind(str, Enum):
    """Kind of a geometry."""

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"
    MESH = "mesh"


class JointKind(str, Enum):
    """Kind of a joint."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"


@dataclass(frozen=True, eq=False, kw_only=True)
class Geometry:
    """A shape of a link.

    Attributes:
        kind: box, cylinder, sphere or mesh.
        numbers: edges of a box [m]; radius and length of a cylinder about z [m]; radius of a sphere [m]; for a mesh,
            the metres per unit of the file along x, y, z.
        file: URI of a mesh, as in the description.
        origin: (3,) [m] of its frame in the link's.
        axes: (3, 3) rotation of its frame in the link's.
        colour: red, green, blue, from 0 to 1; None if the description states none.
    """

    kind: GeometryKind
    numbers: tuple[float, ...]
    file: str = ""
    origin: NDArray[np.float64]
    axes: NDArray[np.float64]
    colour: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Link:
    """A rigid link.

    Attributes:
        name: of the link.
        visuals: its shapes for pictures.
        collisions: its shapes for contact.
    """

    name: str
    visuals: tuple[Geometry, ...] = ()
    collisions: tuple[Geometry, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Mimic:
    """A joint that follows another ``joint``: its position is ``multiplier`` times that joint's, plus ``offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, kw_only=True)
class UrdfLimits:
    """Limits of a joint.

    Attributes:
        lower, upper: of its position [rad] or [m].
        velocity: largest [rad/s] or [m/s].
        acceleration: largest [rad/s^2] or [m/s^2]; infinite if no file states one.
        effort: largest torque [N m] or force [N].
    """

    lower: float
    upper: float
    velocity: float
    acceleration: float = np.inf
    effort: float = np.inf


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint between two links.

    Attributes:
        name: of the joint.
        motion: its kind.
        parent, child: names of its links.
        limits: of a joint that moves; None for a fixed one.
        mimic: the joint that it follows; None if it is commanded itself.
    """

    name: str
    motion: JointKind
    parent: str
    child: str
    limits: UrdfLimits | None = None
    mimic: Mimic | None = None

    @property
    def moves(self) -> bool:
        """Whether it is not fixed."""
        return self.motion is not JointKind.FIXED

    @property
    def unit(self) -> str:
        """Unit of its position."""
        return "m" if self.motion is JointKind.PRISMATIC else "rad"


@dataclass(frozen=True, eq=False, kw_only=True)
class Description:
    """A robot: a tree of links.

    Attributes:
        name: of the robot.
        text: its URDF, with the prefix on the names of links and joints.
        root: name of the link without a parent.
        links: by name, in the order of the file.
        joints: by name, in the order of the file.
    """

    name: str
    text: str
    root: str
    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    parents: Mapping[str, Joint] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parents", {joint.child: joint for joint in self.joints.values()})

    @property
    def commanded(self) -> tuple[Joint, ...]:
        """The joints that take commands, in the order of the file: those that move and do not mimic another joint."""
        return tuple(joint for joint in self.joints.values() if joint.moves and joint.mimic is None)

    def chain(self, link: str) -> list[Joint]:
        """Return the joints from the root to a link."""
        found = []
        while link in self.parents:
            found.append(self.parents[link])
            link = found[-1].parent
        return found[::-1]

    def rigid_with(self, link: str) -> set[str]:
        """Return the names of the links that fixed joints connect with a link, itself included."""
        found, added = {link}, True
        while added:
            ends = [{joint.parent, joint.child} for joint in self.joints.values() if not joint.moves]
            more = set().union(*(pair for pair in ends if pair & found)) - found
            found |= more
            added = bool(more)
        return found

    def mesh_files(self) -> Iterator[str]:
        """Yield the URI of each mesh once."""
        shapes = (shape for link in self.links.values() for shape in (*link.collisions, *link.visuals))
        yield from dict.fromkeys(shape.file for shape in shapes if shape.kind is GeometryKind.MESH)
