# SPDX-License-Identifier: Apache-2.0
"""The key `where` of a scene file: selection of vertices, cells or faces."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from gdfe_ros.mesh.selection import (
    AnyOf,
    BoxSelection,
    CellSelection,
    Face,
    NamedSet,
    Side,
    SphereSelection,
    Vertices,
    Where,
    Within,
)
from gdfe_ros.scene.entry import Choice, Entry
from gdfe_ros.scene.quantity import ANY, Quantity

_INTERVAL = Quantity("interval [low, high] of the coordinate", "m", count=2, ascending=True, infinite=True)
_CENTER = Quantity("center [x, y, z]", "m", count=3)
_RADIUS = Quantity("radius", "m", above=0.0)
_IDS = Quantity("ids, from 0", least=0, most=2**31 - 1, count=ANY, whole=True)

_Interval = Annotated[tuple[float, float], _INTERVAL]


class BoxModel(Entry):
    """A box of closed intervals; an axis that is left out is not limited."""

    x: _Interval | None = None
    y: _Interval | None = None
    z: _Interval | None = None

    @model_validator(mode="after")
    def _some_axis(self) -> BoxModel:
        if self.x is self.y is self.z is None:
            raise ValueError("give at least one axis, e.g. box: {x: [0.0, 0.1]}")
        return self


class SphereModel(Entry):
    """A ball."""

    center: Annotated[tuple[float, float, float], _CENTER]
    radius: Annotated[float, _RADIUS]


class WhereModel(Choice):
    """A selection by exactly one of these keys, in the whole body or in one of the `meshes`; `any` unites several."""

    options: ClassVar[tuple[str, ...]] = ("mesh",)
    alone: ClassVar[tuple[str, ...]] = ("mesh",)

    face: Literal["x-", "x+", "y-", "y+", "z-", "z+"] | None = Field(
        None, description="vertices at the smallest (-) or largest (+) coordinate of the body"
    )
    box: BoxModel | None = None
    sphere: SphereModel | None = None
    vertices: Annotated[tuple[int, ...], _IDS] | None = None
    cells: Annotated[tuple[int, ...], _IDS] | None = None
    set: str | None = Field(None, description="name of a set in the mesh file")
    any: tuple[WhereModel, ...] | None = Field(
        None,
        min_length=1,
        description="the union of several selections, e.g. the roots of two fingers on one flange: "
        "[{mesh: left, face: x-}, {mesh: right, face: x-}]",
    )
    mesh: str | None = Field(
        None,
        description="name of one of the `meshes`; coordinates and ids are then its own; without another key: all of it",
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the meshes to which the selection refers."""
        own = () if self.mesh is None else (self.mesh,)
        return own + tuple(name for place in self.any or () for name in place.names)

    def build(self) -> Where:
        """Return the selection."""
        inner = self._place()
        if self.mesh is not None:
            return Within(self.mesh, inner)
        return inner

    def _place(self) -> Where | None:
        if self.any is not None:
            return AnyOf(tuple(place.build() for place in self.any))
        if self.face is not None:
            return Face(Side(self.face))
        if self.box is not None:
            return BoxSelection(self.box.x, self.box.y, self.box.z)
        if self.sphere is not None:
            return SphereSelection(self.sphere.center, self.sphere.radius)
        if self.vertices is not None:
            return Vertices(self.vertices)
        if self.set is not None:
            return NamedSet(self.set)
        return CellSelection(self.cells) if self.cells is not None else None
