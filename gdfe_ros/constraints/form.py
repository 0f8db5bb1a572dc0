# SPDX-License-Identifier: Apache-2.0
"""Rigid shapes: distances, volumes and inertia, contact points, and faces for pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.keys import Keys
from gdfe_ros.mesh.surfaces.shells import SolidIntegrals, inertia_of
from gdfe_ros.mesh.surfaces.solid import Solid
from gdfe_ros.mesh.surfaces.surface_edges import refine
from gdfe_ros.quantity import Quantity, Vector

Radius = Annotated[float, Quantity("radius", "m", least=1e-9, most=1e6)]
Length = Annotated[float, Quantity("length along z", "m", least=1e-9, most=1e6)]

RIM = 48
"""Number of contact points on each rim of a freely moving cylinder."""
INSET = 0.01
"""Distance of a box's contact points on a face from the rim of the face, divided by the half width of the face. For
points exactly on the rim of another box's equal face, rounding would decide which face is the nearest.
"""
MOST_ALONG = 8
"""Largest number of intervals between contact points along an edge or the axis of a rigid body."""
AROUND = 16
"""Number of points on each circle of a sphere's or capsule's surface. The points are tested for being inside the soft
body.
"""


class Shape(Keys):
    """Base class of shapes.

    Attributes:
        kind: number of this kind of shapes in the kernels.
        numbers: parameters of the shape for the kernels; a plane needs none.
        samples: further numbers for the kernels.
        skin: points of the surface (k, 3) [m]; a plane has none.
        rounding: distance [m] of the surface from the `corners`, or from the lines between them.
    """

    kind: ClassVar[int]
    numbers: tuple[float, float, float] = (0.0, 0.0, 0.0)
    samples: NDArray[np.float64] = np.zeros(0)
    skin: NDArray[np.float64] = np.zeros((0, 3))
    rounding: float = 0.0


@dataclass(frozen=True)
class Plane(Shape):
    """The half space z < 0 in the obstacle's frame."""

    kind: ClassVar[int] = 0


class _Round(Shape):
    """The points within ``radius`` [m] of a segment of the z axis with the ``length`` [m], centred at the origin."""

    radius: float
    length: float

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Parameters of the shape for the kernels: radius [m], half the length [m], 0."""
        return self.radius, 0.5 * self.length, 0.0

    @property
    def rounding(self) -> float:
        """Distance [m] of the surface from the axis with the `corners`: the radius."""
        return self.radius

    @property
    def half(self) -> tuple[float, float, float]:
        """Half edges [m] of the bounding box."""
        return self.radius, self.radius, self.radius + 0.5 * self.length

    @property
    def corners(self) -> NDArray[np.float64]:
        """Points of the axis, (k, 3) [m]; the surface is one radius away from the axis.

        The points are at most a radius apart; a long capsule has 2 `MOST_ALONG` intervals at most.
        """
        heights = np.linspace(-0.5, 0.5, 1 + min(2 * MOST_ALONG, math.ceil(self.length / self.radius))) * self.length
        return heights[:, None] * [0.0, 0.0, 1.0]

    @property
    def skin(self) -> NDArray[np.float64]:
        """Points of the surface, (k, 3) [m]: on circles around both ends, and the poles."""
        turn = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
        rise = np.linspace(0.0, 0.5 * np.pi, AROUND // 4, endpoint=False)
        radii, heights = self.radius * np.cos(rise), self.radius * np.sin(rise) + 0.5 * self.length
        rings = _make_rings(np.concatenate([radii, radii]), np.concatenate([heights, -heights]), turn)
        pole = np.array([0.0, 0.0, self.radius + 0.5 * self.length])
        return np.concatenate([rings.reshape(-1, 3), [pole, -pole]])


@dataclass(frozen=True)
class Sphere(_Round):
    """A ball.

    Its centre is the origin of the obstacle's frame.
    """

    radius: Radius
    length: ClassVar[float] = 0.0
    kind: ClassVar[int] = 1

    @property
    def volume(self) -> float:
        """Volume of the shape [m^3]."""
        return 4.0 / 3.0 * math.pi * self.radius**3

    @property
    def moments(self) -> NDArray[np.float64]:
        """Means of x^2, y^2 and z^2 over the volume, (3,) [m^2]."""
        return np.full(3, self.radius**2 / 5.0)


@dataclass(frozen=True)
class Box(Shape):
    """A box.

    Its centre is the origin of the obstacle's frame.
    """

    size: Annotated[Vector, Quantity("edges [x, y, z]", "m", least=1e-9, most=1e6, count=3)]
    kind: ClassVar[int] = 2

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Parameters of the shape for the kernels: the half edges [m]."""
        x, y, z = self.size
        return 0.5 * x, 0.5 * y, 0.5 * z

    @property
    def half(self) -> tuple[float, float, float]:
        """Half edges of the box [m]."""
        return self.numbers

    @property
    def volume(self) -> float:
        """Volume of the shape [m^3]."""
        return float(np.prod(self.size))

    @property
    def moments(self) -> NDArray[np.float64]:
        """Means of x^2, y^2 and z^2 over the volume, (3,) [m^2]."""
        return np.square(self.size) / 12.0

    @property
    def corners(self) -> NDArray[np.float64]:
        """Corners of the box, (k, 3) [m]; they touch a plane first."""
        return 0.5 * np.array(list(product((-1.0, 1.0), repeat=3))) * self.size

    @property
    def skin(self) -> NDArray[np.float64]:
        """Contact points for other bodies, (k, 3) [m]: the corners, and points of the faces slightly inside the rim."""
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
class Capsule(_Round):
    """A cylinder along z with half balls at its ends; its length is the distance between the centres of the balls.

    Its centre is the origin of the obstacle's frame.
    """

    radius: Radius
    length: Length
    kind: ClassVar[int] = 3

    @property
    def volume(self) -> float:
        """Volume of the shape [m^3]."""
        return math.pi * self.radius**2 * (self.length + 4.0 / 3.0 * self.radius)

    @property
    def moments(self) -> NDArray[np.float64]:
        """Means of x^2, y^2 and z^2 over the volume of a cylinder and two half balls, (3,) [m^2]."""
        r, length = self.radius, self.length
        across = math.pi * r**4 * (length / 4.0 + 4.0 / 15.0 * r)
        along = math.pi * r**2 * (length**3 / 12.0 + r * length**2 / 3.0 + r**2 * length / 2.0 + 4.0 / 15.0 * r**3)
        return np.array([across, across, along]) / self.volume


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder along z.

    Its centre is the origin of the obstacle's frame.
    """

    radius: Radius
    length: Length
    kind: ClassVar[int] = 4

    @property
    def half(self) -> tuple[float, float, float]:
        """Half edges [m] of the bounding box."""
        return self.radius, self.radius, 0.5 * self.length

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Parameters of the shape for the kernels: radius [m], half the length [m], 0."""
        return self.radius, 0.5 * self.length, 0.0

    @property
    def volume(self) -> float:
        """Volume of the shape [m^3]."""
        return float(np.pi * self.radius**2 * self.length)

    @property
    def moments(self) -> NDArray[np.float64]:
        """Means of x^2, y^2 and z^2 over the volume, (3,) [m^2]."""
        return np.array([self.radius**2 / 4.0, self.radius**2 / 4.0, self.length**2 / 12.0])

    @property
    def corners(self) -> NDArray[np.float64]:
        """Points of the two rims, (k, 3) [m]; they touch a plane first."""
        turn = np.linspace(0.0, 2.0 * np.pi, RIM, endpoint=False)
        rim = np.column_stack([self.radius * np.cos(turn), self.radius * np.sin(turn), np.full(RIM, 0.5 * self.length)])
        return np.concatenate([rim, rim * [1.0, 1.0, -1.0]])

    @property
    def skin(self) -> NDArray[np.float64]:
        """Contact points for other bodies, (k, 3) [m]: on the rims, and on circles between them.

        The circles are about a radius apart, but there are at most `MOST_ALONG` intervals.
        """
        count = 1 + min(MOST_ALONG, math.ceil(self.length / self.radius))
        rim = self.corners[:RIM] * [1.0, 1.0, 0.0]
        lifts = np.linspace(-0.5, 0.5, count)[:, None, None] * [0.0, 0.0, self.length]
        return (rim + lifts).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class TriangleMesh(Shape):
    """The solid inside a closed surface, in the obstacle's frame.

    Attributes:
        solid: the solid with its signed distances.
        original: vertices (n, 3) [m] and triangles (t, 3) in the frame of the file, if that frame is not the solid's.
    """

    solid: Solid
    original: tuple[NDArray[np.float64], NDArray[np.int64]] | None = None
    kind: ClassVar[int] = 5

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Parameters of the shape for the kernels: number of `samples`, 0, 0; the samples follow these parameters."""
        return float(len(self.samples)), 0.0, 0.0

    @cached_property
    def samples(self) -> NDArray[np.float64]:
        """Grid of signed distances for the kernels: first point (3,) [m], spacing [m], counts (3,), distances [m]."""
        grid = self.solid
        return np.concatenate([grid.start, [grid.cell], grid.distances.shape, grid.distances.ravel()])

    @property
    def half(self) -> tuple[float, float, float]:
        """Half edges [m] of the smallest box that contains the solid and is centred at the origin."""
        x, y, z = np.abs(self.solid.vertices).max(axis=0).tolist()
        return x, y, z

    @cached_property
    def _inertia(self) -> SolidIntegrals:
        return inertia_of(self.solid.vertices, self.solid.triangles)

    @property
    def volume(self) -> float:
        """Volume of the solid [m^3]."""
        return self._inertia.volume

    @property
    def moments(self) -> NDArray[np.float64]:
        """Means of x^2, y^2 and z^2 over the volume, (3,) [m^2], if x, y, z are the central principal axes."""
        return self._inertia.moments

    @property
    def corners(self) -> NDArray[np.float64]:
        """Vertices of the surface, (k, 3) [m]; they touch a plane first."""
        return self.solid.vertices[np.unique(self.solid.triangles)]

    @cached_property
    def skin(self) -> NDArray[np.float64]:
        """Points of the refined surface, (k, 3) [m]; edges between them are at most an eighth of the longest extent."""
        longest = float(np.ptp(self.solid.vertices, axis=0).max()) / MOST_ALONG
        points, triangles = refine(self.solid.vertices, self.solid.triangles, longest)
        return points[np.unique(triangles)]


Form = Plane | Sphere | Box | Capsule | Cylinder | TriangleMesh


FACES_AROUND, FACES_ALONG = 32, 16
"""Number of faces of a drawn round shape around its axis, and number of faces from pole to pole."""


def form_faces(form: Sphere | Box | Capsule | Cylinder | TriangleMesh) -> NDArray[np.float64]:
    """Return the corners (f, k, 3) [m] of the faces of a shape, in the shape's frame."""
    match form:
        case Sphere(radius):
            return _revolve(radius * np.sin(_polar()), radius * np.cos(_polar()))
        case Capsule(radius, length):
            polar = np.concatenate([_polar()[: FACES_ALONG // 2 + 1], _polar()[FACES_ALONG // 2 :]])
            ends = np.repeat([0.5 * length, -0.5 * length], FACES_ALONG // 2 + 1)
            return _revolve(radius * np.sin(polar), radius * np.cos(polar) + ends)
        case Cylinder(radius, length):
            return _revolve(np.array([0.0, radius, radius, 0.0]), 0.5 * length * np.array([1.0, 1.0, -1.0, -1.0]))
        case Box(size):
            square = np.array([[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]])
            sides = [np.roll(side, axis, axis=1) for axis in range(3) for side in (square, -square[::-1])]
            return 0.5 * np.array(sides) * size
        case TriangleMesh(solid):
            return solid.vertices[solid.triangles]


def _make_rings(
    radii: NDArray[np.float64], heights: NDArray[np.float64], turn: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return points (k, t, 3) [m] at angles ``turn`` (t,) on circles about z, with ``radii`` and ``heights`` (k,)."""
    places = np.outer(radii, np.cos(turn)), np.outer(radii, np.sin(turn)), np.tile(heights[:, None], len(turn))
    return np.stack(places, axis=-1)


def _polar() -> NDArray[np.float64]:
    return np.linspace(0.0, np.pi, FACES_ALONG + 1)


def _revolve(radii: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners (q, 4, 3) [m] of the quads of a surface of revolution about z.

    Its profile has the ``radii`` at the ``heights`` [m].
    """
    rings = _make_rings(radii, heights, np.linspace(0.0, 2.0 * np.pi, FACES_AROUND + 1))
    corners = rings[:-1, :-1], rings[1:, :-1], rings[1:, 1:], rings[:-1, 1:]
    return np.stack(corners, axis=2).reshape(-1, 4, 3)
