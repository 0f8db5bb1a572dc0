# SPDX-License-Identifier: Apache-2.0
"""Several meshes as one: computations use one mesh, selections may refer to a part in its own frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.hexmesh import HexMesh
from gdfe_ros.mesh.outside import Outside
from gdfe_ros.mesh.subset import join
from gdfe_ros.mesh.touching import Touching


@dataclass(frozen=True, eq=False)
class MeshPart:
    """A mesh among others.

    Attributes:
        mesh: in its own frame, as it was made or read.
        at: origin of that frame [m], shape (3,).
        rotation: its axes, as columns, shape (3, 3).
        first_vertex: index of its first vertex among all; the others follow in their order.
        first_cell: index of its first cell among all.
    """

    mesh: HexMesh
    at: NDArray[np.float64]
    rotation: NDArray[np.float64]
    first_vertex: int = 0
    first_cell: int = 0

    def placed(self) -> HexMesh:
        """Return the mesh at its place; a part that is neither rotated nor moved keeps its coordinates bit by bit."""
        vertices = self.mesh.vertices
        if not np.array_equal(self.rotation, np.eye(3)):
            vertices = vertices @ self.rotation.T
        if self.at.any():
            vertices = vertices + self.at
        return replace(self.mesh, vertices=vertices)


def assemble(parts: Mapping[str, MeshPart]) -> HexMesh:
    """Return one mesh of all parts, in their order; vertices at the same place stay separate.

    Sets of one name are united, and the parts are available by name in `HexMesh.parts`. If one part has a skin, the
    faces of the others are added to it.

    Args:
        parts: meshes with their places; their indices are set here.
    """
    meshes = [part.placed() for part in parts.values()]
    vertices = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)]).tolist()
    cells = np.cumsum([0, *(mesh.n_cells for mesh in meshes)]).tolist()
    numbered = {
        name: replace(part, first_vertex=first_vertex, first_cell=first_cell)
        for (name, part), first_vertex, first_cell in zip(parts.items(), vertices, cells, strict=False)
    }
    skin = None
    if any(mesh.skin is not None for mesh in meshes):
        skin = Outside.joined([mesh.outside for mesh in meshes], vertices, cells)
    touching = [
        (mesh.touching, first_vertex, first_cell)
        for mesh, first_vertex, first_cell in zip(meshes, vertices, cells, strict=False)
        if mesh.touching is not None
    ]
    touching = Touching.joined(touching) if touching else None
    return replace(join(*meshes), skin=skin, touching=touching, parts=numbered)
