# SPDX-License-Identifier: Apache-2.0
"""Rigid obstacles: like a handle they are moved by a pose, but they hold nothing and are touched instead."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from itertools import product
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints.handle import Handle
from gdfe_ros.constraints.pose import Pose
from gdfe_ros.mesh.solid import Solid

NO_SAMPLES = np.zeros(0)

RIM = 48
"""Points on each rim of a cylinder that moves freely."""
INSET = 0.01
"""Share of its half width by which points of a box' face are off its rim: over the rim of an equal face it is chance
which side of that is nearer."""
MOST_ALONG = 8
"""Intervals between points along a rigid body, at most."""


@dataclass(frozen=True)
class Plane:
    """The half space below z = 0 of the obstacle's frame."""

    kind: ClassVar[int] = 0
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """What the kernels read."""
        return 0.0, 0.0, 0.0


@dataclass(frozen=True)
class Sphere:
    """A ball about the origin of the obstacle's frame, of a ``radius`` [m]."""

    radius: float
    kind: ClassVar[int] = 1
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """What the kernels read."""
        return self.radius, 0.0, 0.0


@dataclass(frozen=True)
class Box:
    """A box about the origin of the obstacle's frame, of a ``size`` (x, y, z) [m]."""

    size: tuple[float, float, float]
    kind: ClassVar[int] = 2
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """What the kernels read."""
        x, y, z = self.size
        return 0.5 * x, 0.5 * y, 0.5 * z

    @property
    def volume(self) -> float:
        """Its volume [m^3]."""
        return float(np.prod(self.size))

    @property
    def moments(self) -> NDArray[np.float64]:
        """Mean squares of x, y, z over its volume (3,) [m^2]."""
        return np.square(self.size) / 12.0

    @property
    def corners(self) -> NDArray[np.float64]:
        """Points (k, 3) [m] that touch before any other does: its corners."""
        return 0.5 * np.array(list(product((-1.0, 1.0), repeat=3))) * self.size

    @property
    def skin(self) -> NDArray[np.float64]:
        """Points (k, 3) [m] that touch other bodies: its corners, and points of its faces, a little off their rims."""
        half, found = 0.5 * np.array(self.size), [self.corners]
        for axis in range(3):
            others = [other for other in range(3) if other != axis]
            lines = [(1.0 - INSET) * np.linspace(-half[other], half[other], self._along(other)) for other in others]
            for side in (-half[axis], half[axis]):
                face = np.empty((len(lines[0]) * len(lines[1]), 3))
                face[:, axis], face[:, others] = side, list(product(*lines))
                found.append(face)
        return np.concatenate(found)

    def _along(self, axis: int) -> int:
        return 1 + min(MOST_ALONG, math.ceil(self.size[axis] / min(self.size)))


@dataclass(frozen=True)
class Capsule:
    """All that is nearer than ``radius`` [m] to a segment of z of a ``length`` [m], centred at the origin."""

    radius: float
    length: float
    kind: ClassVar[int] = 3
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """What the kernels read."""
        return self.radius, 0.5 * self.length, 0.0


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about z of a ``radius`` and a ``length`` [m], centred at the origin."""

    radius: float
    length: float
    kind: ClassVar[int] = 4
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """What the kernels read."""
        return self.radius, 0.5 * self.length, 0.0

    @property
    def volume(self) -> float:
        """Its volume [m^3]."""
        return float(np.pi * self.radius**2 * self.length)

    @property
    def moments(self) -> NDArray[np.float64]:
        """Mean squares of x, y, z over its volume (3,) [m^2]."""
        return np.array([self.radius**2 / 4.0, self.radius**2 / 4.0, self.length**2 / 12.0])

    @property
    def corners(self) -> NDArray[np.float64]:
        """Points (k, 3) [m] of its two rims."""
        turn = np.linspace(0.0, 2.0 * np.pi, RIM, endpoint=False)
        rim = np.column_stack([self.radius * np.cos(turn), self.radius * np.sin(turn), np.full(RIM, 0.5 * self.length)])
        return np.concatenate([rim, rim * [1.0, 1.0, -1.0]])

    @property
    def skin(self) -> NDArray[np.float64]:
        """Points (k, 3) [m] that touch other bodies: of its rims, and of circles between them about a radius apart."""
        count = 1 + min(MOST_ALONG, math.ceil(self.length / self.radius))
        rim = self.corners[:RIM] * [1.0, 1.0, 0.0]
        lifts = np.linspace(-0.5, 0.5, count)[:, None, None] * [0.0, 0.0, self.length]
        return (rim + lifts).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """What a closed surface bounds, in the obstacle's frame."""

    solid: Solid
    kind: ClassVar[int] = 5

    @property
    def numbers(self) -> tuple[float, float, float]:
        """How many samples the kernels find behind all else."""
        return float(len(self.samples)), 0.0, 0.0

    @cached_property
    def samples(self) -> NDArray[np.float64]:
        """The grid as the kernels read it: first point (3,) [m], spacing [m], counts (3,), distances [m]."""
        grid = self.solid
        return np.concatenate([grid.start, [grid.cell], grid.distances.shape, grid.distances.ravel()])


Form = Plane | Sphere | Box | Capsule | Cylinder | TriangleMesh


def _no_vertices() -> NDArray[np.int32]:
    return np.zeros(0, dtype=np.int32)


class ContactPoints(str, Enum):
    """How gaps are taken: as the mean about each vertex over the faces there, or at the vertex alone."""

    FACES = "faces"
    VERTICES = "vertices"


@dataclass(frozen=True, eq=False, kw_only=True)
class Obstacle(Handle):
    """A rigid shape that the body cannot enter.

    What it exerts on the body is its reaction, as a handle's, with the moment about the origin of its frame.

    Attributes:
        vertices: none.
        form: its shape.
        origin: of its frame at rest [m].
        turn: of its frame at rest, a rotation vector [rad].
        friction: Coulomb's coefficient.
        points: how gaps are taken.
    """

    noun: ClassVar[str] = "obstacle"
    section: ClassVar[str] = "obstacles"
    vertices: NDArray[np.int32] = field(default_factory=_no_vertices)
    form: Form
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction: float = 0.0
    points: ContactPoints = ContactPoints.FACES

    def seen_from(self, origin: NDArray[np.float64]) -> Obstacle:
        """Return the obstacle for who counts positions from ``origin`` (3,) [m]."""
        return replace(self, origin=tuple(np.subtract(self.origin, origin).tolist()))

    def centre(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the origin (3,) [m] of its frame at rest, wherever the body's ``vertices`` are."""
        return np.array(self.origin)

    def pose(self, commanded: Pose, positions: NDArray[np.float64]) -> Pose:
        """Return where it is, relative to rest: where it is commanded to be."""
        return commanded

    def frame(self, pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return origin (3,) [m] and rotation (3, 3) of its frame where it is moved by ``pose``."""
        turned = Rotation.from_rotvec(pose.rotation) * Rotation.from_rotvec(self.turn)
        return np.add(self.origin, pose.translation), turned.as_matrix()
