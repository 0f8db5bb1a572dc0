# SPDX-License-Identifier: Apache-2.0
"""Links, joints and shapes of a robot, as its URDF describes them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints.form import Box, Cylinder, Sphere
from gdfe_ros.untrusted.real_number import require_command


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
        form: the shape; None for a mesh.
        file: URI of a mesh, as in the description.
        scale: metres per unit of a mesh file along x, y, z.
        origin: origin of the shape's frame (3,) [m], in the link's frame.
        axes: rotation of the shape's frame (3, 3) relative to the link's frame.
        colour: red, green, blue, from 0 to 1; None if the description states none.
    """

    form: Box | Cylinder | Sphere | None = None
    file: str = ""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    origin: NDArray[np.float64]
    axes: NDArray[np.float64]
    colour: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Link:
    """A rigid link.

    Attributes:
        name: name of the link.
        visuals: shapes for pictures.
        collisions: shapes for contact.
    """

    name: str
    visuals: tuple[Geometry, ...] = ()
    collisions: tuple[Geometry, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Mimic:
    """Coupling of a joint to another ``joint``: position = ``multiplier`` * position of ``joint`` + ``offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, kw_only=True)
class UrdfLimits:
    """Limits of a joint.

    Attributes:
        lower, upper: least and largest position [rad] or [m].
        velocity: largest speed [rad/s] or [m/s].
        acceleration: largest acceleration [rad/s^2] or [m/s^2]; infinite if neither URDF nor scene states one.
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
        name: name of the joint.
        motion: kind of the joint.
        parent, child: names of the two links that it connects.
        limits: limits of a joint that accepts commands; None for a fixed joint and for one that mimics another.
        mimic: coupling to another joint; None for a joint without a coupling.
    """

    name: str
    motion: JointKind
    parent: str
    child: str
    limits: UrdfLimits | None = None
    mimic: Mimic | None = None

    @property
    def moves(self) -> bool:
        """Whether the joint can move: it is not fixed."""
        return self.motion is not JointKind.FIXED

    @property
    def unit(self) -> str:
        """Unit of the joint's position: m or rad."""
        return "m" if self.motion is JointKind.PRISMATIC else "rad"

    @property
    def effort_unit(self) -> str:
        """Unit of the joint's torque or force."""
        return "N m" if self.unit == "rad" else "N"

    def require(self, value: object) -> float:
        """Check a commanded position [rad] or [m] of a joint with limits, and return it as a float.

        Raises:
            CommandError: the value is not a finite number within the joint's limits.
        """
        given = {"low": self.limits.lower, "high": self.limits.upper, "unit": self.unit}
        remedy = "remedy: a position within the joint's limits, or `limits` of the arm in the scene"
        return require_command(f"joint {self.name!r}: position", value, **given, remedy=remedy)


@dataclass(frozen=True, eq=False, kw_only=True)
class Description:
    """A robot: a tree of links.

    Attributes:
        name: name of the robot.
        text: URDF, with the prefix on the names of links and joints.
        root: name of the link without a parent.
        links: dict from name to link, in the order of the file.
        joints: dict from name to joint, in the order of the file.
        remarks: messages about implausible or ignored content of the URDF.
        parents: dict from link to the joint that connects it to its parent.
    """

    name: str
    text: str
    root: str
    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    remarks: tuple[str, ...] = ()
    parents: Mapping[str, Joint] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parents", {joint.child: joint for joint in self.joints.values()})

    @property
    def commanded(self) -> tuple[Joint, ...]:
        """Joints that accept commands: they move and do not mimic another joint. In the order of the file."""
        return tuple(joint for joint in self.joints.values() if joint.moves and joint.mimic is None)

    def chain(self, link: str) -> list[Joint]:
        """Return the joints between the root and a ``link``, from the root on."""
        found = []
        while link in self.parents:
            found.append(self.parents[link])
            link = found[-1].parent
        return found[::-1]

    def rigid_with(self, link: str) -> set[str]:
        """Return the names of the links that only fixed joints connect with a ``link``, this link included."""
        found, fixed = {link}, [{joint.parent, joint.child} for joint in self.joints.values() if not joint.moves]
        while more := set().union(*(pair for pair in fixed if pair & found)) - found:
            found |= more
        return found

    def mesh_files(self) -> Iterator[str]:
        """Yield the URI of each mesh file once."""
        shapes = (shape for link in self.links.values() for shape in (*link.collisions, *link.visuals))
        yield from dict.fromkeys(shape.file for shape in shapes if shape.file)

    def collision_files(self, links: Iterable[str]) -> set[str]:
        """Return the URIs of the mesh files among the collision shapes of ``links``."""
        shapes = (shape for name in links for shape in self.links[name].collisions)
        return {shape.file for shape in shapes if shape.file}
