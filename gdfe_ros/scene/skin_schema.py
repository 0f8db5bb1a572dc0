# SPDX-License-Identifier: Apache-2.0
"""The key `skin` of a scene file: a surface that is drawn, and optionally touches, instead of the faces of cells."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.contact_skin import is_closed, touch_by_skin
from gdfe_ros.mesh.outside import carry_skin
from gdfe_ros.mesh.packing import pack_surface, unpack_surface
from gdfe_ros.mesh.voxels import examine_surface
from gdfe_ros.scene.entry import Choice
from gdfe_ros.scene.paths import FilePath
from gdfe_ros.scene.quantity import Quantity

SCALE = Quantity("metres per unit of the file", above=0.0, most=1000.0, remedy="millimetres: 0.001")


class SkinModel(Choice):
    """A triangle surface that follows the cells and is drawn instead of their faces; loads on cut cells act on it."""

    options: ClassVar[tuple[str, ...]] = ("scale", "contact")

    file: FilePath | None = Field(
        None, description="path of an STL, OBJ, PLY or OFF file, in the undeformed body's frame"
    )
    embedded: str | None = Field(None, description="a packed surface, as recorded scenes contain it")
    scale: Annotated[float, SCALE] | None = None
    contact: bool | None = Field(
        None,
        description="true: the skin touches in place of the cells' faces; default: true if "
        "cells are cut and the skin is closed",
    )

    @property
    def place(self) -> tuple[str, ...]:
        """Key path of the surface's file or embedded text, relative to this entry, for errors."""
        return (self.chosen[0],)

    def build(self, mesh: HexMesh) -> tuple[HexMesh, dict[str, Any]]:
        """Return the mesh with the skin, and an equivalent entry that contains the surface instead of its file.

        Raises:
            MeshError: the surface cannot be read, does not fit the body, or cannot be used for contact.
        """
        if self.embedded is not None:
            points, triangles = unpack_surface(self.embedded)
        else:
            points, triangles, defects = examine_surface(self.file, scale=self.scale, closed=False)
            if defects:
                raise MeshError(f"surface {self.file}", defects)
        entry = {"embedded": pack_surface(points, triangles)}
        if self.contact is not None:
            entry["contact"] = self.contact
        lined = replace(mesh, skin=carry_skin(mesh.vertices, mesh.cells, points, triangles))
        touches = self.contact
        if touches is None:  # an open surface is only drawn; contact with it is rejected with the remedy
            touches = mesh.filling is not None and is_closed(triangles)
        return touch_by_skin(lined, points, triangles) if touches else lined, entry
