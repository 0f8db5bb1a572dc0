# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file for bodies that are generated from a few parameters."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.generators import bar, cut, finger, grid
from gdfe_ros.mesh.round_bodies import ring, sphere, tube
from gdfe_ros.scene.entry import Entry
from gdfe_ros.scene.quantity import ANY, Quantity
from gdfe_ros.scene.where_schema import WhereModel

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
_CELLS = _count("number of cells along x, y, z", count=3)
_RADIUS = _length("mean radius of the ring")
_INNER = _length("inner radius")
_OUTER = _length("outer radius")
_LENGTH = _length("length")
_TUBE_CELLS = _count("numbers of cells through the wall, around the axis, along it", count=3)
_RING_CELLS = _count("numbers of cells across the width, around the axis, along the height", count=3)
_SPHERE_CELLS = _count(
    "numbers of cells along each edge of the cube that is mapped to the sphere, through the wall", count=2
)
_CAP = _length("thickness of the cap at each end; 0: open ends", least=0.0)
_CAP_CELLS = _count("number of cells through each cap")
_SECTION = _length("width along the radius, height", count=2)
_ANGLE = Quantity("opening of the arc", "degrees", above=0.0, most=360.0)
_JOINTS = _count("number of joints")
_GAP = _length("width of each notch")
_WEB = _length("height of the web above each notch")
_CELL = _length("largest edge of a cell")
_PLANES = Quantity(
    "coordinates of the planes between the cells", "m", least=-LONGEST, most=LONGEST, count=ANY, ascending=True
)
_TAPER = Quantity("size at the tip over size at the base", above=0.0, most=1.0)


class Generated(Entry):
    """A generated body; too many cells are rejected before the mesh is made."""

    @property
    def count(self) -> int:
        """Approximate number of cells."""
        return math.prod(self.cells)

    @model_validator(mode="after")
    def _not_too_many(self) -> Generated:
        if self.count > MOST_CELLS:
            raise ValueError(f"about {self.count} cells; allowed: up to {MOST_CELLS}; use fewer; sizes are in metres")
        return self


class BarModel(Generated):
    """A straight bar along x, from x = 0, centred on y = z = 0; cells can be removed from it."""

    size: Annotated[tuple[float, float, float], _SIZE]
    cells: Annotated[tuple[int, int, int], _CELLS]
    cut: tuple[WhereModel, ...] = Field((), description="cells to take out: cavities, notches, windows")

    def build(self) -> HexMesh:
        """Return the mesh."""
        whole = bar(self.size, self.cells)
        return cut(whole, [where.build() for where in self.cut]) if self.cut else whole


class GridModel(Generated):
    """A block divided by planes perpendicular to x, y and z, with any spacing; cells can be removed from it."""

    x: Annotated[tuple[float, ...], _PLANES]
    y: Annotated[tuple[float, ...], _PLANES]
    z: Annotated[tuple[float, ...], _PLANES]
    cut: tuple[WhereModel, ...] = Field((), description="cells to take out: cavities, notches, windows")

    @property
    def count(self) -> int:
        """Number of cells before the cuts."""
        return math.prod(len(planes) - 1 for planes in (self.x, self.y, self.z))

    def build(self) -> HexMesh:
        """Return the mesh."""
        whole = grid(self.x, self.y, self.z)
        return cut(whole, [where.build() for where in self.cut]) if self.cut else whole


class TubeModel(Generated):
    """A tube along x, from x = 0; with caps it encloses a chamber."""

    inner: Annotated[float, _INNER]
    outer: Annotated[float, _OUTER]
    length: Annotated[float, _LENGTH]
    cells: Annotated[tuple[int, int, int], _TUBE_CELLS]
    cap: Annotated[float, _CAP] = 0.0
    cap_cells: Annotated[int, _CAP_CELLS] = 1

    def build(self) -> HexMesh:
        """Return the mesh."""
        return tube(self.inner, self.outer, self.length, self.cells, cap=self.cap, cap_cells=self.cap_cells)


class RingModel(Generated):
    """A ring, or an arc of a ring, about the z axis."""

    radius: Annotated[float, _RADIUS]
    section: Annotated[tuple[float, float], _SECTION]
    cells: Annotated[tuple[int, int, int], _RING_CELLS]
    angle: Annotated[float, _ANGLE] = 360.0

    def build(self) -> HexMesh:
        """Return the mesh."""
        return ring(self.radius, self.section, self.cells, angle=self.angle)


class SphereShellModel(Generated):
    """A hollow sphere about the origin."""

    inner: Annotated[float, _INNER]
    outer: Annotated[float, _OUTER]
    cells: Annotated[tuple[int, int], _SPHERE_CELLS]

    @property
    def count(self) -> int:
        """Number of cells."""
        return 6 * self.cells[0] ** 2 * self.cells[1]

    def build(self) -> HexMesh:
        """Return the mesh."""
        return sphere(self.inner, self.outer, self.cells)


class FingerModel(Generated):
    """A finger along x, from x = 0, centred on y = z = 0: links joined by thin webs, with notches open towards -z.

    The length of a link is (length - joints * gap) / (joints + 1), where length is the first number of ``size``.
    """

    size: Annotated[tuple[float, float, float], _SIZE]
    joints: Annotated[int, _JOINTS]
    gap: Annotated[float, _GAP]
    web: Annotated[float, _WEB]
    cell: Annotated[float, _CELL]
    taper: Annotated[float, _TAPER] = 1.0

    @property
    def count(self) -> int:
        """Approximate number of cells."""
        return math.prod(max(1, math.ceil(length / self.cell)) for length in self.size)

    def build(self) -> HexMesh:
        """Return the mesh."""
        given = dict(self)
        return finger(given.pop("size"), **given)
