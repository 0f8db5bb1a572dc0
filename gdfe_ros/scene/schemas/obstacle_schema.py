# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file for obstacles, rigid bodies, self-contact and contact sensors."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints.form import Box, Capsule, Cylinder, Form, Plane, Sphere, TriangleMesh
from gdfe_ros.constraints.obstacle import ContactPoints, Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.mesh.contact_skin import out_of_material
from gdfe_ros.mesh.files.stored_mesh import pack_surface
from gdfe_ros.mesh.selection import Where
from gdfe_ros.mesh.surfaces.shells import inertia_of
from gdfe_ros.mesh.surfaces.solid import make_solid, require_outward
from gdfe_ros.quantity import Quantity, RotationQuantity, Vector
from gdfe_ros.scene.base_entry import Choice, Entry, belongs, one_of
from gdfe_ros.scene.schemas.mesh_schema import SurfaceModel

_NORMAL = Quantity(
    "normal of a plane, out of the obstacle [x, y, z]", least=-1e6, most=1e6, count=3, direction="[0, 0, 1] for a floor"
)
_AT = Quantity(
    "initial position [x, y, z] of its centre; for a plane, of any of its points; for a mesh, of the file's origin",
    "m",
    count=3,
)
_ROTATION = RotationQuantity("initial rotation vector [x, y, z], or several in turn about fixed axes")
_CELL = Quantity(
    "spacing of the grid that stores the distances to the surface; default: 1/64 of its longest edge",
    "m",
    above=0.0,
    most=1e6,
)
_FRICTION = Quantity("Coulomb's coefficient of friction", least=0.0, most=100.0)
_RESTITUTION = Quantity(
    "ratio of the normal speeds of a point after and before an impact; in motion, the larger value of two bodies",
    least=0.0,
    most=1.0,
)


class TriangleMeshModel(SurfaceModel):
    """The solid inside a closed surface of triangles; nested shells are cavities."""

    options: ClassVar[tuple[str, ...]] = ("scale", "cell")

    cell: Annotated[float, _CELL] | None = None

    _scale_of_a_file = belongs("scale", "file", "scale belongs to `file`; remove it here")

    @property
    def where(self) -> str:
        """Name of the surface in errors."""
        return "the embedded surface" if self.file is None else f"surface {self.file}"

    def build(self) -> TriangleMesh:
        """Return the shape in the frame of the file.

        Raises:
            MeshError: the surface cannot be read, or is no valid solid.
        """
        return TriangleMesh(make_solid(*self.read(closed=True), cell=self.cell, where=self.where))

    def build_free(self) -> tuple[TriangleMesh, NDArray[np.float64], NDArray[np.float64]]:
        """Return the shape in its principal frame, and the origin (3,) [m] and the axes (3, 3) of this frame.

        The origin is the centre of mass, and the axes are the principal axes of inertia, both in the file's frame.

        Raises:
            MeshError: the surface cannot be read, or is no valid solid.
        """
        vertices, triangles = self.read(closed=True)
        require_outward(vertices, triangles, where=self.where)
        found = inertia_of(vertices, out_of_material(vertices, triangles))
        solid = make_solid((vertices - found.centre) @ found.axes, triangles, cell=self.cell, where=self.where)
        return TriangleMesh(solid, original=(vertices, triangles)), found.centre, found.axes

    def embed(self, form: TriangleMesh) -> dict[str, Any]:
        """Return an equivalent entry that contains the surface instead of its file."""
        vertices, triangles = form.original or (form.solid.vertices, form.solid.triangles)
        return {"embedded": pack_surface(vertices, triangles), "cell": form.solid.cell}


class _Rigid(Choice):
    """Base class of obstacles and rigid bodies: one shape, its initial pose, and its contact parameters."""

    sphere: Sphere | None = None
    box: Box | None = None
    capsule: Capsule | None = None
    cylinder: Cylinder | None = None
    mesh: TriangleMeshModel | None = None
    at: Annotated[Vector, _AT] = (0.0, 0.0, 0.0)
    rotation_deg: Annotated[Vector, _ROTATION] = (0.0, 0.0, 0.0)
    friction: Annotated[float, _FRICTION] = 0.0
    restitution: Annotated[float, _RESTITUTION] = 0.0
    gaps: ContactPoints = Field(
        ContactPoints.FACES,
        description="the gap that contact uses at a vertex of the body; faces: the mean gap of the faces around it; "
        "vertices: the gap of the vertex alone",
    )

    @property
    def form(self) -> Form:
        """Shape of the obstacle or body.

        Raises:
            MeshError: its surface cannot be read, or is no valid solid.
        """
        kind, chosen = self.chosen
        return Plane() if kind == "plane" else chosen.build() if kind == "mesh" else chosen

    @property
    def turn(self) -> Rotation:
        """Initial rotation."""
        return Rotation.from_rotvec(np.radians(self.rotation_deg))

    @property
    def contact(self) -> dict[str, Any]:
        """Contact parameters as keyword arguments of `Obstacle`."""
        return {"friction": self.friction, "restitution": self.restitution, "points": self.gaps}


class ObstacleModel(_Rigid):
    """A rigid object that the body cannot penetrate; a commanded pose moves it like a handle."""

    options: ClassVar[tuple[str, ...]] = ("at", "rotation_deg", "friction", "restitution", "fixed", "gaps")

    plane: Annotated[Vector, _NORMAL] | None = None
    fixed: bool = Field(False, description="true: the obstacle never moves and takes no commands")

    def build(self, name: str) -> Obstacle:
        """Return the obstacle.

        Raises:
            MeshError: its surface cannot be read, or is no valid solid.
        """
        turn = self.turn
        if self.plane is not None:
            normal = np.ldexp(self.plane, -np.frexp(np.abs(self.plane).max())[1])  # squares of tiny numbers are zero
            turn = turn * Rotation.align_vectors([normal], [[0.0, 0.0, 1.0]])[0]
        place = {"origin": self.at, "turn": tuple(turn.as_rotvec().tolist())}
        return Obstacle(name=name, fixed=self.fixed, form=self.form, **place, **self.contact)


class BodyModel(_Rigid):
    """A rigid body that moves freely and touches the soft body, obstacles and rigid bodies; it needs `dynamics`."""

    options: ClassVar[tuple[str, ...]] = ("density", "mass", "at", "rotation_deg", "friction", "restitution", "gaps")

    density: Annotated[float, Quantity("density", "kg/m^3", least=1e-9, most=1e6)] | None = None
    mass: Annotated[float, Quantity("mass, instead of the density", "kg", least=1e-15, most=1e6)] | None = None

    _one_of_density_and_mass = one_of(
        "density", "mass", "give exactly one of density [kg/m^3] and mass [kg], e.g. density: 500"
    )

    def build(self, name: str) -> RigidBody:
        """Return the rigid body, without vertex ids.

        If its shape is a mesh, the origin of its frame is the centre of mass, and the axes are the principal axes,
        instead of the origin and the axes of the file.

        Raises:
            MeshError: its surface cannot be read, or is no valid solid.
        """
        place = {"origin": self.at, "turn": tuple(np.radians(self.rotation_deg).tolist())}
        if self.mesh is None:
            form = self.form
        else:
            form, centre, axes = self.mesh.build_free()
            turn = (self.turn * Rotation.from_matrix(axes)).as_rotvec()
            place = {"origin": tuple((self.at + self.turn.apply(centre)).tolist()), "turn": tuple(turn.tolist())}
        mass = self.density * form.volume if self.mass is None else self.mass
        return RigidBody(name=name, form=form, mass=mass, **place, **self.contact)


class SensorModel(Entry):
    """A part of the surface whose contact forces are measured."""

    where: Where = Field(
        description="the sensor's faces: all faces with all four vertices in this place, e.g. {face: x+}"
    )


class SelfContactModel(Entry):
    """Contact of the parts of the mesh with each other, and of each part with itself."""

    friction: Annotated[float, _FRICTION] = 0.0
    restitution: Annotated[float, _RESTITUTION] = 0.0
    where: Where | None = Field(
        None, description="the faces that take part: all faces with all four vertices in this place (default: all)"
    )
