# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file for obstacles, rigid bodies and contact sensors."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, field_validator, model_validator
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints.obstacle import (
    Box,
    Capsule,
    ContactPoints,
    Cylinder,
    Form,
    Obstacle,
    Plane,
    Sphere,
    TriangleMesh,
)
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.mesh.packing import pack_surface, unpack_surface
from gdfe_ros.mesh.solid import make_solid, read_solid
from gdfe_ros.scene.entry import Choice, Entry
from gdfe_ros.scene.paths import FilePath
from gdfe_ros.scene.quantity import Quantity
from gdfe_ros.scene.where_schema import WhereModel

_LENGTH = Quantity("length along z", "m", above=0.0, most=1e6)
_RADIUS = Quantity("radius", "m", above=0.0, most=1e6)
_SIZE = Quantity("edges [x, y, z]", "m", above=0.0, most=1e6, count=3)
_NORMAL = Quantity("normal of a plane, out of the obstacle [x, y, z]", least=-1e6, most=1e6, count=3)
_AT = Quantity(
    "position at rest [x, y, z] of its centre; for a plane, of any of its points; for a mesh, of the file's origin",
    "m",
    count=3,
)
_ROTATION = Quantity("rotation vector at rest [x, y, z]", "degrees", least=-36000, most=36000, count=3)
_DENSITY = Quantity("density", "kg/m^3", above=0.0, most=1e6)
_SCALE = Quantity("metres per unit of the file", above=0.0, most=1000.0, remedy="millimetres: 0.001")
_CELL = Quantity(
    "spacing of the grid that stores the distances to the surface; default: 1/64 of its longest edge",
    "m",
    above=0.0,
    most=1e6,
)
_FRICTION = Quantity("Coulomb's coefficient of friction", least=0.0, most=100.0)


class SphereObstacleModel(Entry):
    """A ball."""

    radius: Annotated[float, _RADIUS]


class BoxObstacleModel(Entry):
    """A box."""

    size: Annotated[tuple[float, float, float], _SIZE]


class CapsuleModel(Entry):
    """A cylinder about z with round ends; its length is the distance of their centres."""

    radius: Annotated[float, _RADIUS]
    length: Annotated[float, _LENGTH]


class CylinderModel(Entry):
    """A cylinder about z."""

    radius: Annotated[float, _RADIUS]
    length: Annotated[float, _LENGTH]


class TriangleMeshModel(Choice):
    """The solid inside a closed surface of triangles; nested shells are cavities."""

    options: ClassVar[tuple[str, ...]] = ("scale", "cell")

    file: FilePath | None = Field(None, description="path of an STL, OBJ, PLY or OFF file")
    embedded: str | None = Field(None, description="a packed surface, as recorded scenes contain it")
    scale: Annotated[float, _SCALE] | None = None
    cell: Annotated[float, _CELL] | None = None

    @model_validator(mode="after")
    def _scale_of_a_file(self) -> TriangleMeshModel:
        if self.scale is not None and self.file is None:
            raise ValueError("scale belongs to `file`; remove it here")
        return self

    def build(self) -> TriangleMesh:
        """Return the shape.

        Raises:
            MeshError: the surface cannot be read or used.
        """
        if self.file is not None:
            return TriangleMesh(read_solid(self.file, scale=self.scale, cell=self.cell))
        return TriangleMesh(make_solid(*unpack_surface(self.embedded), cell=self.cell, where="the embedded surface"))

    def embed(self, form: TriangleMesh) -> dict[str, Any]:
        """Return the entry that contains the surface itself."""
        solid = form.solid
        return {"embedded": pack_surface(solid.vertices, solid.triangles), "cell": solid.cell}


class ObstacleModel(Choice):
    """A rigid object that the body cannot enter; a pose moves it like a handle."""

    options: ClassVar[tuple[str, ...]] = ("at", "rotation_deg", "friction", "fixed", "gaps")

    plane: Annotated[tuple[float, float, float], _NORMAL] | None = None
    sphere: SphereObstacleModel | None = None
    box: BoxObstacleModel | None = None
    capsule: CapsuleModel | None = None
    cylinder: CylinderModel | None = None
    mesh: TriangleMeshModel | None = None
    at: Annotated[tuple[float, float, float], _AT] = (0.0, 0.0, 0.0)
    rotation_deg: Annotated[tuple[float, float, float], _ROTATION] = (0.0, 0.0, 0.0)
    friction: Annotated[float, _FRICTION] = 0.0
    fixed: bool = Field(False, description="true: the obstacle never moves and takes no commands")
    gaps: ContactPoints = Field(
        ContactPoints.FACES,
        description="the gap at a vertex of the body: faces: the mean gap of the faces around it; vertices: the gap of "
        "the vertex alone",
    )

    @field_validator("plane")
    @classmethod
    def _direction(cls, normal: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
        if normal is not None and not any(normal):
            raise ValueError("must not be zero; needed: a direction, e.g. [0, 0, 1] for a floor")
        return normal

    def build(self, name: str) -> Obstacle:
        """Return the obstacle.

        Raises:
            MeshError: its surface cannot be read or used.
        """
        turn = Rotation.from_rotvec(np.radians(self.rotation_deg))
        if self.plane is not None:
            turn = turn * Rotation.align_vectors([self.plane], [[0.0, 0.0, 1.0]])[0]
        return Obstacle(
            name=name,
            fixed=self.fixed,
            form=self._form(),
            origin=self.at,
            turn=tuple(turn.as_rotvec().tolist()),
            friction=self.friction,
            points=self.gaps,
        )

    def _form(self) -> Form:
        if self.sphere is not None:
            return Sphere(self.sphere.radius)
        if self.box is not None:
            return Box(self.box.size)
        if self.capsule is not None:
            return Capsule(self.capsule.radius, self.capsule.length)
        if self.cylinder is not None:
            return Cylinder(self.cylinder.radius, self.cylinder.length)
        return self.mesh.build() if self.mesh is not None else Plane()


class BodyModel(Choice):
    """A rigid body that moves freely; it touches the body and obstacles, and needs `dynamics`."""

    options: ClassVar[tuple[str, ...]] = ("density", "at", "rotation_deg", "friction", "gaps")

    box: BoxObstacleModel | None = None
    cylinder: CylinderModel | None = None
    density: Annotated[float, _DENSITY]
    at: Annotated[tuple[float, float, float], _AT] = (0.0, 0.0, 0.0)
    rotation_deg: Annotated[tuple[float, float, float], _ROTATION] = (0.0, 0.0, 0.0)
    friction: Annotated[float, _FRICTION] = 0.0
    gaps: ContactPoints = Field(ContactPoints.FACES, description="as for obstacles")

    def build(self, name: str, first: int) -> RigidBody:
        """Return the rigid body with vertex ids from ``first`` on."""
        form: Form = Box(self.box.size) if self.box else Cylinder(self.cylinder.radius, self.cylinder.length)
        return RigidBody(
            name=name,
            form=form,
            mass=self.density * form.volume,
            origin=self.at,
            turn=tuple(np.radians(self.rotation_deg).tolist()),
            friction=self.friction,
            points=self.gaps,
        ).numbered(first)


class SensorModel(Entry):
    """A part of the surface whose contact forces are measured."""

    where: WhereModel = Field(
        description="the sensor's faces: all faces with all four vertices in this place, e.g. {face: x+}"
    )
