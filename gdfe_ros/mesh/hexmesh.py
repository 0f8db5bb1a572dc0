# SPDX-License-Identifier: Apache-2.0
"""The hexahedral mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.faces import Faces, boundary_faces
from gdfe_ros.mesh.mesh import Mesh


@dataclass(frozen=True, eq=False, repr=False)
class HexMesh(Mesh):
    """A mesh of 8-vertex hexahedra.

    The vertices of ``cells`` (m, 8) are in VTK's order: the four bottom vertices, counter-clockwise seen from the top,
    then the four top vertices, each above its bottom vertex. The other attributes are those of `Mesh`.
    """

    nodes: ClassVar[int] = 8
    noun: ClassVar[str] = "hexahedra"
    vtk: ClassVar[str] = "hexahedron"

    @cached_property
    def centroids(self) -> NDArray[np.float64]:
        """Mean of the eight vertices of each cell [m], shape (m, 3)."""
        return self.vertices[self.cells].mean(axis=1)

    @cached_property
    def boundary(self) -> Faces:
        """Faces that belong to one cell only, oriented out of the material."""
        return boundary_faces(self.cells)
