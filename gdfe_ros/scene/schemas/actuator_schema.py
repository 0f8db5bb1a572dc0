# SPDX-License-Identifier: Apache-2.0
"""The keys `actuators`, `loads`, `masses` and `probes` of a scene file."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from gdfe_ros.actuators import Mode
from gdfe_ros.mesh.selection import Where
from gdfe_ros.quantity import Quantity, Vector
from gdfe_ros.scene.base_entry import TAG, Choice, Entry, one_of

_RANGE = Quantity("range [low, high] of the command", count=2, ascending=True, infinite=True)
_RATE = Quantity("largest change of the command per second, in the command's unit", above=0.0, most=1e15)
_CAVITY = Quantity("number of the cavity; 0 is the largest", least=0, most=100_000, whole=True)
_FORCE = Quantity("force [x, y, z]", "N", least=-1e9, most=1e9, count=3)
_TRACTION = Quantity("traction [x, y, z], force per undeformed area", "Pa", least=-1e12, most=1e12, count=3)

_PRESSURE = Quantity("pressure at factor 1; positive pushes into the material", "Pa", least=-1e12, most=1e12)

Point3 = Annotated[Vector, Quantity("point [x, y, z]", "m", least=-1e3, most=1e3, count=3)]
_MESH = "name of one of the `meshes`; the coordinates are then in its own frame"


class PlaceModel(Entry):
    """A point in one of the `meshes`."""

    mesh: str = Field(description=_MESH)
    at: Point3


def _kind_of_place(value: Any) -> str:
    return TAG + ("place" if isinstance(value, dict | PlaceModel) else "point")


Place = Annotated[
    Annotated[Point3, Tag(TAG + "point")] | Annotated[PlaceModel, Tag(TAG + "place")], Discriminator(_kind_of_place)
]


class AnchorModel(Entry):
    """A point in the world."""

    world: Point3


def _kind_of_end(value: Any) -> str:
    given = value if isinstance(value, dict) else {"world": 0} if isinstance(value, AnchorModel) else {}
    return TAG + "anchor" if "world" in given else _kind_of_place(value)


CablePoint = Annotated[
    Annotated[Point3, Tag(TAG + "point")]
    | Annotated[PlaceModel, Tag(TAG + "place")]
    | Annotated[AnchorModel, Tag(TAG + "anchor")],
    Discriminator(_kind_of_end),
]


class DriveModel(Entry):
    """Keys of every actuator."""

    range: Annotated[tuple[float, float], _RANGE] | None = None
    rate: Annotated[float, _RATE] | None = None

    @property
    def mode(self) -> Mode:
        """Quantity that the command prescribes, from the key ``command``; entries without this key override it."""
        return Mode(self.command)


class CableModel(DriveModel):
    """A frictionless cable through points of the body, of several bodies, and of the world.

    With friction, the tension behind a bend also depends on where the cable was last pulled, and where released. For
    friction while it is pulled, give each stretch between two points a cable of its own, with the tension T exp(-mu a)
    behind bends of the total angle a.
    """

    points: tuple[CablePoint, ...] = Field(
        description="two or more points, e.g. [[0, 0, 0.01], [0.1, 0, 0.01]]; a point with a mesh belongs to one of "
        "the `meshes`, and {world: [0, 0, 0.3]} is a pulley or a motor that stays where it is in the world",
        min_length=2,
    )
    mesh: str | None = Field(None, description=_MESH)
    command: Literal["tension", "length", "shortening"] = Field(
        "tension", description="the commanded quantity: tension [N], length [m] or shortening [m]"
    )
    stiffness: Annotated[float, Quantity("stiffness of the whole cable", "N/m", above=0.0, most=1e12)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _without_friction(cls, given: Any) -> Any:
        if isinstance(given, dict) and "friction" in given:
            raise ValueError(
                "friction: a cable has none, because the tension behind a bend also depends on where the cable was "
                "last pulled, and where released; remedy, while it is pulled: a cable for each stretch between two "
                "points, with the tension T exp(-mu a) behind bends of the total angle a [rad]"
            )
        return given

    @model_validator(mode="after")
    def _points_apart(self) -> CableModel:
        if any(a == b for a, b in pairwise(self.points)):
            raise ValueError("points: give two or more; consecutive points must differ")
        if all(isinstance(point, AnchorModel) for point in self.points):
            raise ValueError("points: all are in the world; give at least one point of a body")
        if self.stiffness is not None and self.command == "tension":
            raise ValueError(
                "stiffness belongs to command: length or shortening; remove it if the command is a tension"
            )
        return self


class ChamberModel(DriveModel):
    """A closed surface filled with a fluid, or one with open edges on handles; with cut cells, a shell of the skin."""

    cavity: Annotated[int, _CAVITY] | None = None
    near: Point3 | None = Field(None, description="selects the cavity whose centre is nearest to this point [x, y, z]")
    where: Where | None = Field(
        None, description="selects the chamber's faces: all faces with all four vertices in this place"
    )
    mesh: str | None = Field(None, description="name of one of the `meshes`, to which `cavity` and `near` refer")
    command: Literal["pressure", "volume"] = Field(
        "pressure", description="the commanded quantity: pressure [Pa] or volume [m^3]"
    )

    @model_validator(mode="after")
    def _one_place(self) -> ChamberModel:
        if sum(place is not None for place in (self.cavity, self.near, self.where)) > 1:
            raise ValueError("give only one of cavity, near, where; none of them is needed if the body has one cavity")
        if self.where is not None and self.mesh is not None:
            raise ValueError(f"mesh cannot stand beside where; write it inside: where: {{mesh: {self.mesh}, ...}}")
        return self


class GrowthModel(DriveModel):
    """Cells that grow or shrink."""

    mode: ClassVar = Mode.GROWTH
    stretch: Annotated[Vector, Quantity("stretch along x, y, z at command 1", least=0.05, most=20.0, count=3)]
    where: Where | None = Field(
        None, description="the cells that grow (default: all); if it names a mesh, x, y, z are that mesh's own axes"
    )


class GripModel(Entry):
    """A suction cup, a vacuum or a magnet: it holds a rigid body or vertices, and can release them.

    At command 1, the held body or vertices keep their present pose relative to the holder; at 0 they are free.
    """

    mode: ClassVar = Mode.GRIP
    to: str = Field(description="name of the handle, obstacle or rigid body that holds")
    body: str | None = Field(None, description="name of the rigid body that is held")
    where: Where | None = Field(
        None, description="the held vertices of the soft body, e.g. {face: x+}; with `to` a rigid body, a suction face"
    )
    reach: Annotated[float, Quantity("largest distance from which it takes hold", "m", above=0.0, most=1e3)] = 0.005

    _one_thing = one_of(
        "body", "where", "give exactly one of body (a rigid body) and where (vertices of the soft body)"
    )

    @model_validator(mode="after")
    def _another(self) -> GripModel:
        if self.body == self.to:
            raise ValueError(f"{self.to!r} cannot hold itself; `to` is what holds, `body` is what is held")
        return self


class ActuatorModel(Choice):
    """An actuator, with exactly one of these keys."""

    cable: CableModel | None = None
    chamber: ChamberModel | None = None
    growth: GrowthModel | None = None
    grip: GripModel | None = None


class PointLoadModel(Entry):
    """A force at a point of the body."""

    at: Point3 = Field(description="point of the body [x, y, z]")
    mesh: str | None = Field(None, description=_MESH)
    force: Annotated[Vector, _FORCE]


class SurfaceLoadModel(Entry):
    """A traction on faces, or a total force that is distributed evenly over their undeformed area."""

    where: Where = Field(
        description="the loaded faces: all faces with all four vertices in this place, e.g. {face: x+}"
    )
    traction: Annotated[Vector, _TRACTION] | None = None
    force: Annotated[Vector, _FORCE] | None = None

    _one_size = one_of("traction", "force", "give either traction [Pa] or force [N]")


class PressureLoadModel(Entry):
    """A pressure that follows the faces on which it acts, with any edges: Abaqus' `*DSLOAD P`."""

    where: Where = Field(
        description="the loaded faces: all faces with all four vertices in this place, e.g. {face: z+}"
    )
    pressure: Annotated[float, _PRESSURE]


class LoadModel(Choice):
    """A dead load (constant in size and direction) or a follower pressure, with exactly one of these keys."""

    gravity: Annotated[Vector, Quantity("acceleration [x, y, z]", "m/s^2", least=-1e6, most=1e6, count=3)] | None = None
    point: PointLoadModel | None = None
    surface: SurfaceLoadModel | None = None
    pressure: PressureLoadModel | None = None


class MassModel(Entry):
    """A mass that is attached to vertices or to a probe: it adds weight under gravity, and inertia in motion."""

    mass: Annotated[float, Quantity("mass", "kg", above=0.0, most=1e6)]
    where: Where | None = Field(
        None, description="the vertices among which the mass is divided equally, e.g. {face: x+}"
    )
    probe: str | None = Field(None, description="name of the probe that the mass is attached to")

    _one_place = one_of("where", "probe", "give either where or probe")
