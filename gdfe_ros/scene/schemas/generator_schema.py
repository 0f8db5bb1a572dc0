# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file for bodies that are generated from a few parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.generators import bar, cut, finger, grid, ring, sphere, tube
from gdfe_ros.mesh.selection import Where
from gdfe_ros.quantity import ANY, Quantity, Vector
from gdfe_ros.scene.base_entry import Entry

#: Limit of the number of cells; more cells need tens of gigabytes of memory and are probably a mistake.
MOST_CELLS = 5_000_000
#: Limit of lengths [m]; a larger value is probably in millimetres.
LONGEST = 100.0


def _length(meaning: str, *, count: int | None = None, least: float | None = None) -> Quantity:
    above = 0.0 if least is None else None
    remedy = "lengths are in metres: 200 mm is 0.2"
    return Quantity(meaning, "m", above=above, least=least, most=LONGEST, count=count, remedy=remedy)


def _count(meaning: str, *, count: int | None = None) -> Quantity:
    return Quantity(meaning, least=1, most=100_000, count=count, whole=True)


_SIZE = _length("length, width, height", count=3)
_INNER = _length("inner radius")
_OUTER = _length("outer radius")
_TUBE_CELLS = _count("numbers of cells through the wall, around the axis, along it", count=3)
_RING_CELLS = _count("numbers of cells across the width, around the axis, along the height", count=3)
_SPHERE_CELLS = _count(
    "numbers of cells along each edge of the cube that is mapped to the sphere, through the wall", count=2
)
_PLANES = Quantity(
    "coordinates of the planes between the cells", "m", least=-LONGEST, most=LONGEST, count=ANY, ascending=True
)


class Generated(Entry):
    """A body that the function ``make`` generates from its keys; too many cells are rejected before it is made."""

    make: ClassVar[Callable[..., HexMesh]]

    @property
    def count(self) -> int:
        """Approximate number of cells."""
        return math.prod(self.cells)

    @model_validator(mode="after")
    def _not_too_many(self) -> Generated:
        if self.count > MOST_CELLS:
            raise ValueError(f"about {self.count} cells; allowed: up to {MOST_CELLS}; use fewer; sizes are in metres")
        return self

    def build(self) -> HexMesh:
        """Return the mesh, without the cells to take out."""
        given = dict(self)
        holes = given.pop("cut", ())
        mesh = type(self).make(**given)
        return cut(mesh, holes) if holes else mesh


class BarModel(Generated):
    """A straight bar along x, from x = 0, centred on y = z = 0; cells can be removed from it."""

    make: ClassVar[Callable[..., HexMesh]] = bar
    size: Annotated[Vector, _SIZE]
    cells: Annotated[tuple[int, int, int], _count("number of cells along x, y, z", count=3)]
    cut: tuple[Where, ...] = Field((), description="cells to take out: cavities, notches, windows")


class GridModel(Generated):
    """A block divided by planes perpendicular to x, y and z, with any spacing; cells can be removed from it."""

    make: ClassVar[Callable[..., HexMesh]] = grid
    x: Annotated[tuple[float, ...], _PLANES]
    y: Annotated[tuple[float, ...], _PLANES]
    z: Annotated[tuple[float, ...], _PLANES]
    cut: tuple[Where, ...] = Field((), description="cells to take out: cavities, notches, windows")

    @property
    def count(self) -> int:
        """Number of cells before the cuts."""
        return math.prod(len(planes) - 1 for planes in (self.x, self.y, self.z))


class TubeModel(Generated):
    """A tube along x, from x = 0; with caps it encloses a chamber."""

    make: ClassVar[Callable[..., HexMesh]] = tube
    inner: Annotated[float, _INNER]
    outer: Annotated[float, _OUTER]
    length: Annotated[float, _length("length")]
    cells: Annotated[tuple[int, int, int], _TUBE_CELLS]
    cap: Annotated[float, _length("thickness of the cap at each end; 0: open ends", least=0.0)] = 0.0
    cap_cells: Annotated[int, _count("number of cells through each cap")] = 1


class RingModel(Generated):
    """A ring, or an arc of a ring, about the z axis."""

    make: ClassVar[Callable[..., HexMesh]] = ring
    radius: Annotated[float, _length("mean radius of the ring")]
    section: Annotated[tuple[float, float], _length("width along the radius, height", count=2)]
    cells: Annotated[tuple[int, int, int], _RING_CELLS]
    angle: Annotated[float, Quantity("opening of the arc", "degrees", above=0.0, most=360.0)] = 360.0


class SphereShellModel(Generated):
    """A hollow sphere about the origin."""

    make: ClassVar[Callable[..., HexMesh]] = sphere
    inner: Annotated[float, _INNER]
    outer: Annotated[float, _OUTER]
    cells: Annotated[tuple[int, int], _SPHERE_CELLS]

    @property
    def count(self) -> int:
        """Number of cells."""
        return 6 * self.cells[0] ** 2 * self.cells[1]


class FingerModel(Generated):
    """A finger along x, from x = 0, centred on y = z = 0: links joined by thin webs, with notches open towards -z.

    The length of a link is (length - joints * gap) / (joints + 1), where length is the first number of ``size``.
    """

    make: ClassVar[Callable[..., HexMesh]] = finger
    size: Annotated[Vector, _SIZE]
    joints: Annotated[int, _count("number of joints")]
    gap: Annotated[float, _length("width of each notch")]
    web: Annotated[float, _length("height of the web above each notch")]
    cell: Annotated[float, _length("largest edge of a cell")]
    taper: Annotated[float, Quantity("size at the tip over size at the base", above=0.0, most=1.0)] = 1.0

    @property
    def count(self) -> int:
        """Approximate number of cells."""
        return math.prod(max(1, math.ceil(length / self.cell)) for length in self.size)
