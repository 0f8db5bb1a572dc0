# SPDX-License-Identifier: Apache-2.0
"""Rigid obstacles: a pose moves them like a handle, but they hold no vertices and act by contact."""

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
"""Points on each rim of a freely moving cylinder."""
INSET = 0.01
"""Distance of the points of a box's face from its rim, over the half width. At the rim of an equal face, rounding would
decide which side is nearer."""
MOST_ALONG = 8
"""Limit of intervals between points along a rigid body."""


@dataclass(frozen=True)
class Plane:
    """The half space below z = 0 of the obstacle's frame."""

    kind: ClassVar[int] = 0
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Parameters of the shape for the kernels."""
        return 0.0, 0.0, 0.0


@dataclass(frozen=True)
class Sphere:
    """A ball of a ``radius`` [m] around the origin of the obstacle's frame."""

    radius: float
    kind: ClassVar[int] = 1
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Parameters of the shape for the kernels."""
        return self.radius, 0.0, 0.0


@dataclass(frozen=True)
class Box:
    """A box of a ``size`` (x, y, z) [m] around the origin of the obstacle's frame."""

    size: tuple[float, float, float]
    kind: ClassVar[int] = 2
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Parameters of the shape for the kernels."""
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
        """Its corners (k, 3) [m], the points that touch first."""
        return 0.5 * np.array(list(product((-1.0, 1.0), repeat=3))) * self.size

    @property
    def skin(self) -> NDArray[np.float64]:
        """Contact points (k, 3) [m] for other bodies: its corners, and points of its faces slightly inside the rims."""
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
    """The points nearer than ``radius`` [m] to a segment of z of a ``length`` [m], centred at the origin."""

    radius: float
    length: float
    kind: ClassVar[int] = 3
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Parameters of the shape for the kernels."""
        return self.radius, 0.5 * self.length, 0.0


@dataclass(frozen=True)
class Cylinder:
    """A cylinder of a ``radius`` and a ``length`` [m] around z, centred at the origin."""

    radius: float
    length: float
    kind: ClassVar[int] = 4
    samples: ClassVar[NDArray[np.float64]] = NO_SAMPLES

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Parameters of the shape for the kernels."""
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
        """Contact points (k, 3) [m] for other bodies: of its rims, and of circles between them about a radius apart."""
        count = 1 + min(MOST_ALONG, math.ceil(self.length / self.radius))
        rim = self.corners[:RIM] * [1.0, 1.0, 0.0]
        lifts = np.linspace(-0.5, 0.5, count)[:, None, None] * [0.0, 0.0, self.length]
        return (rim + lifts).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """The solid inside a closed surface, in the obstacle's frame."""

    solid: Solid
    kind: ClassVar[int] = 5

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Number of samples that the kernels find after all other numbers."""
        return float(len(self.samples)), 0.0, 0.0

    @cached_property
    def samples(self) -> NDArray[np.float64]:
        """The grid in the layout of the kernels: first point (3,) [m], spacing [m], counts (3,), distances [m]."""
        grid = self.solid
        return np.concatenate([grid.start, [grid.cell], grid.distances.shape, grid.distances.ravel()])


Form = Plane | Sphere | Box | Capsule | Cylinder | TriangleMesh


def _no_vertices() -> NDArray[np.int32]:
    return np.zeros(0, dtype=np.int32)


class ContactPoints(str, Enum):
    """Evaluation of gaps: mean over the faces around each vertex, or at the vertex alone."""

    FACES = "faces"
    VERTICES = "vertices"


@dataclass(frozen=True, eq=False, kw_only=True)
class Obstacle(Handle):
    """A rigid shape that the body cannot enter.

    Its force on the body is its reaction, as for a handle, with the moment about the origin of its frame.

    Attributes:
        vertices: none.
        form: its shape.
        origin: of its frame at rest [m].
        turn: of its frame at rest, a rotation vector [rad].
        friction: Coulomb's coefficient.
        points: evaluation of gaps.
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
        """Return the obstacle relative to ``origin`` (3,) [m]."""
        return replace(self, origin=tuple(np.subtract(self.origin, origin).tolist()))

    def centre(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the origin (3,) [m] of its frame at rest, whatever the body's ``vertices``."""
        return np.array(self.origin)

    def pose(self, commanded: Pose, positions: NDArray[np.float64]) -> Pose:
        """Return its pose relative to rest: the commanded one."""
        return commanded

    def frame(self, pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return origin (3,) [m] and rotation (3, 3) of its frame at ``pose``."""
        turned = Rotation.from_rotvec(pose.rotation) * Rotation.from_rotvec(self.turn)
        return np.add(self.origin, pose.translation), turned.as_matrix()
