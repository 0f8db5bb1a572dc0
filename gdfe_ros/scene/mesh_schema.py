# SPDX-License-Identifier: Apache-2.0
"""The key `mesh` of a scene file: where the body comes from."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.importer import read_mesh
from gdfe_ros.mesh.packing import pack_mesh, unpack_mesh
from gdfe_ros.mesh.voxels import Cells, read_voxels
from gdfe_ros.scene.entry import Choice, Entry
from gdfe_ros.scene.generator_schema import BarModel, FingerModel, GridModel, RingModel, SphereShellModel, TubeModel
from gdfe_ros.scene.paths import FilePath
from gdfe_ros.scene.quantity import Quantity

SCALE = Quantity("metres for each unit of the file", above=0.0, most=1000.0, remedy="millimetres: 0.001")
_CELL = Quantity("edge of the cubes", "m", above=0.0, most=1.0)


class VoxelsModel(Entry):
    """A closed surface filled with cubes."""

    surface: FilePath = Field(description="STL, OBJ, PLY or OFF file")
    cell: Annotated[float, _CELL]
    scale: Annotated[float, SCALE] | None = None
    cells: Cells = Field(
        Cells.WHOLE,
        description="whole: the cubes whose centres lie inside; cut: every cube that the surface leaves material in, "
        "its stiffness and mass those of what is filled",
    )

    def build(self) -> HexMesh:
        """Return the mesh."""
        return read_voxels(self.surface, cell=self.cell, scale=self.scale, cells=self.cells)


class MeshModel(Choice):
    """Exactly one kind of body."""

    options: ClassVar[tuple[str, ...]] = ("scale", "merge", "first_order")

    bar: BarModel | None = None
    grid: GridModel | None = None
    tube: TubeModel | None = None
    ring: RingModel | None = None
    sphere: SphereShellModel | None = None
    finger: FingerModel | None = None
    file: FilePath | None = Field(None, description="hexahedra in a .msh, .vtk, .vtu or .inp file")
    voxels: VoxelsModel | None = None
    embedded: str | None = Field(None, description="a mesh as a recorded scene carries it")
    scale: Annotated[float, SCALE] | None = None
    merge: bool = Field(False, description="make vertices at the same place one")
    first_order: bool = Field(False, description="take the corners of second-order hexahedra")

    @model_validator(mode="after")
    def _options_of_a_file(self) -> MeshModel:
        given = [name for name in self.options if getattr(self, name)]
        if given and self.file is None:
            raise ValueError(f"{', '.join(given)} belongs to `file`; remove it here")
        return self

    @property
    def place(self) -> tuple[str, ...]:
        """Key path of what describes the body, for errors."""
        kind = self.chosen[0]
        return ("mesh", kind, "surface") if kind == "voxels" else ("mesh", kind)

    def build(self) -> HexMesh:
        """Return the mesh.

        Raises:
            MeshError: the mesh cannot be made or read.
        """
        kind, value = self.chosen
        if kind == "file":
            return read_mesh(value, scale=self.scale, merge=self.merge, first_order=self.first_order)
        return unpack_mesh(value) if kind == "embedded" else value.build()

    def embed(self, mesh: HexMesh) -> dict[str, str] | None:
        """Return the entry that carries the mesh itself, or None if the entry needs no file."""
        return {"embedded": pack_mesh(mesh)} if self.chosen[0] in ("file", "voxels") else None
