# SPDX-License-Identifier: Apache-2.0
"""The keys `mesh`, `meshes` and `skin` of a scene file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from gdfe_ros.mesh import HexMesh, Mesh, TetMesh
from gdfe_ros.mesh.assembly import mirror
from gdfe_ros.mesh.contact_skin import touch_by_skin
from gdfe_ros.mesh.files.importer import read_mesh
from gdfe_ros.mesh.files.mesher_process import estimate_cells
from gdfe_ros.mesh.files.stored_mesh import pack_surface, unpack_mesh, unpack_surface
from gdfe_ros.mesh.mesh import MeshPart
from gdfe_ros.mesh.meshing.tetrahedralise import from_step, from_surface, step_volume
from gdfe_ros.mesh.meshing.voxels import CutCubes, examine_surface, read_surface, read_voxels
from gdfe_ros.mesh.outside import carry_skin
from gdfe_ros.mesh.surfaces.shells import shells
from gdfe_ros.mesh.surfaces.surface_edges import is_closed
from gdfe_ros.quantity import Quantity, RotationQuantity, Vector
from gdfe_ros.scene.base_entry import Choice, Entry, belongs
from gdfe_ros.scene.schemas.generator_schema import (
    BarModel,
    FingerModel,
    GridModel,
    RingModel,
    SphereShellModel,
    TubeModel,
)
from gdfe_ros.scene.schemas.paths import FilePath

SCALE = Quantity("metres per unit of the file", above=0.0, most=1000.0, remedy="millimetres: 0.001")


class SurfaceModel(Choice):
    """A surface of triangles, in a file or packed."""

    options: ClassVar[tuple[str, ...]] = ("scale",)

    file: FilePath | None = Field(None, description="path of an STL, OBJ, PLY or OFF file")
    embedded: str | None = Field(None, description="a packed surface, as recorded scenes contain it")
    scale: Annotated[float, SCALE] | None = None

    def read(self, *, closed: bool) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return vertices (n, 3) [m] and triangles (t, 3).

        Raises:
            MeshError: the surface cannot be read, or is open although it must be ``closed``.
        """
        if self.embedded is not None:
            return unpack_surface(self.embedded)
        return read_surface(self.file, scale=self.scale, closed=closed)


class SkinModel(SurfaceModel):
    """A triangle surface that follows the cells and is drawn instead of their faces; loads on cut cells act on it."""

    options: ClassVar[tuple[str, ...]] = ("scale", "contact")

    file: FilePath | None = Field(
        None, description="path of an STL, OBJ, PLY or OFF file, in the undeformed body's frame"
    )
    contact: bool | None = Field(
        None,
        description="true: the skin touches in place of the cells' faces; default: true if "
        "cells are cut and the skin is closed",
    )

    def build(self, mesh: HexMesh) -> tuple[HexMesh, str]:
        """Return the mesh with the skin, and the packed surface.

        Raises:
            MeshError: the surface cannot be read, does not fit the body, or cannot be used for contact.
        """
        points, triangles = self.read(closed=False)
        lined = replace(mesh, skin=carry_skin(mesh.vertices, mesh.cells, points, triangles))
        touches = self.contact
        if touches is None:  # an open surface is only drawn; contact with it is rejected with the remedy
            touches = mesh.filling is not None and is_closed(triangles)
        return touch_by_skin(lined, points, triangles) if touches else lined, pack_surface(points, triangles)


SIZE = Quantity("largest edge of the tetrahedra", "m", above=0.0, most=1.0)
LEAST_SIZE = Quantity("smallest edge of the tetrahedra, at thin walls", "m", above=0.0, most=1.0)
_AT = Quantity("position of the origin of its own frame [x, y, z]", "m", least=-1e3, most=1e3, count=3)
_ROTATION = RotationQuantity("rotation vector of its own frame [x, y, z], or several in turn about fixed axes")
_OF_A_FILE = ("scale", "merge", "first_order")
_ANYWHERE = (*_OF_A_FILE, "mirror")


class VoxelsModel(Entry):
    """A body of cubes that fill a closed surface."""

    surface: FilePath = Field(description="path of an STL, OBJ, PLY or OFF file with a closed surface")
    cell: Annotated[float, Quantity("edge of the cubes", "m", above=0.0, most=1.0)]
    scale: Annotated[float, SCALE] | None = None
    cells: CutCubes = Field(
        CutCubes.WHOLE,
        description="whole: only cubes whose centres lie inside the surface; cut: every cube that is partly inside, "
        "with the stiffness and mass of the part that is inside",
    )

    @property
    def count(self) -> float:
        """Approximate number of cells; raise `MeshError` if the surface cannot be read."""
        return _volume(self.surface, self.scale) / self.cell**3

    def build(self) -> HexMesh:
        """Return the mesh."""
        return read_voxels(self.surface, cell=self.cell, scale=self.scale, cells=self.cells)


class TetsModel(Choice):
    """A body of quadratic tetrahedra that fill a surface or the solids of a STEP file."""

    options: ClassVar[tuple[str, ...]] = ("size", "least_size", "scale")

    surface: FilePath | None = Field(None, description="path of an STL, OBJ, PLY or OFF file; holes are closed")
    step: FilePath | None = Field(None, description="path of a STEP file with one or more solids, in its own unit")
    size: Annotated[float, SIZE]
    least_size: Annotated[float, LEAST_SIZE] | None = None
    scale: Annotated[float, SCALE] | None = None

    @model_validator(mode="after")
    def _least_of_all(self) -> TetsModel:
        if self.least_size is not None and self.least_size > self.size:
            raise ValueError(f"least_size = {self.least_size:g} m; allowed: up to size = {self.size:g} m")
        return self

    _scale_of_a_surface = belongs(
        "scale", "surface", "scale belongs to `surface`; a STEP file states its unit; remove it here"
    )

    @property
    def count(self) -> float:
        """Approximate number of cells; raise `MeshError` if the file cannot be read."""
        volume = _volume(self.surface, self.scale) if self.step is None else step_volume(self.step)
        return estimate_cells(volume, self.size)

    def build(self) -> TetMesh:
        """Return the mesh."""
        if self.step is not None:
            return from_step(self.step, size=self.size, least_size=self.least_size)
        return from_surface(self.surface, size=self.size, scale=self.scale, least_size=self.least_size)


class MeshModel(Choice):
    """The mesh of the body, with exactly one of these keys."""

    options: ClassVar[tuple[str, ...]] = _ANYWHERE

    bar: BarModel | None = None
    grid: GridModel | None = None
    tube: TubeModel | None = None
    ring: RingModel | None = None
    sphere: SphereShellModel | None = None
    finger: FingerModel | None = None
    file: FilePath | None = Field(
        None, description="path of a .msh, .vtk, .vtu or .inp file with hexahedra or tetrahedra"
    )
    voxels: VoxelsModel | None = None
    tets: TetsModel | None = None
    embedded: str | None = Field(None, description="a packed mesh, as recorded scenes contain it")
    scale: Annotated[float, SCALE] | None = None
    merge: bool = Field(False, description="merge vertices at the same position")
    first_order: bool = Field(False, description="use only the corners of second-order hexahedra")
    mirror: Literal["x", "y", "z"] | None = Field(
        None,
        description="reflects the mesh, with its skin, in its own frame at the plane x = 0, y = 0 or z = 0: a left "
        "hand from the file of a right one; all other keys refer to the reflected mesh",
    )

    @model_validator(mode="before")
    @classmethod
    def _one_mesh(cls, entry: Any) -> Any:
        kinds = cls.model_fields.keys()
        parts = entry.values() if isinstance(entry, dict) and not entry.keys() & kinds else ()
        if parts and all(isinstance(part, dict) and part.keys() & kinds for part in parts):
            raise ValueError(f"lists several meshes: {', '.join(entry)}; remedy: rename the key `mesh` to `meshes`")
        return entry

    @model_validator(mode="after")
    def _options_of_a_file(self) -> MeshModel:
        given = [name for name in _OF_A_FILE if getattr(self, name)]
        if given and self.file is None:
            raise ValueError(f"{', '.join(given)} belongs to `file`; remove it here")
        return self

    @property
    def place(self) -> tuple[str, ...]:
        """Key path, relative to this entry, of the chosen kind of mesh or of its file; errors name it."""
        kind = self.chosen[0]
        if kind == "tets":
            return (kind, self.tets.chosen[0])
        return (kind, "surface") if kind == "voxels" else (kind,)

    @property
    def count(self) -> float:
        """Approximate number of cells of a generated mesh; 0 if the mesh is in a file or packed.

        Raises:
            MeshError: the surface or solid that is filled cannot be read.
        """
        value = self.chosen[1]
        return 0 if isinstance(value, (str, Path)) else value.count

    def build(self) -> Mesh:
        """Return the mesh.

        Raises:
            MeshError: the mesh cannot be made or read.
        """
        kind, value = self.chosen
        if kind == "file":
            return read_mesh(value, scale=self.scale, merge=self.merge, first_order=self.first_order)
        return unpack_mesh(value) if kind == "embedded" else value.build()

    @property
    def reads(self) -> bool:
        """Whether the mesh or its surface is in a file."""
        return self.chosen[0] in ("file", "voxels", "tets")

    def reflect(self, mesh: Mesh) -> Mesh:
        """Return a mesh (from `build`, with its skin), reflected as the key `mirror` states."""
        return mesh if self.mirror is None else mirror(mesh, "xyz".index(self.mirror))


class PlacedMeshModel(MeshModel):
    """One of several meshes, with its pose and exactly one of these keys."""

    options: ClassVar[tuple[str, ...]] = (*_ANYWHERE, "at", "rotation_deg", "skin")

    at: Annotated[Vector, _AT] = (0.0, 0.0, 0.0)
    rotation_deg: Annotated[Vector, _ROTATION] = (0.0, 0.0, 0.0)
    skin: SkinModel | None = None

    def place_part(self, mesh: Mesh) -> MeshPart:
        """Return a mesh from `build` with the pose of this entry."""
        turn = Rotation.from_rotvec(np.radians(self.rotation_deg)).as_matrix()
        return MeshPart(mesh, at=np.array(self.at), rotation=turn)


def _volume(surface: Path, scale: float | None) -> float:
    """Return the volume [m^3] inside a surface file; for an open surface, the volume of its bounding box."""
    vertices, triangles, _ = examine_surface(surface, scale=scale, closed=False)
    if not is_closed(triangles):
        return float(np.prod(np.ptp(vertices, axis=0)))
    return shells(vertices, triangles).volume
