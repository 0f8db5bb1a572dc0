# SPDX-License-Identifier: Apache-2.0
"""Assembly of several meshes into one mesh; a selection may refer to one of these meshes, in the frame of this mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gdfe_ros.mesh.hexmesh import HexMesh
from gdfe_ros.mesh.mesh import MeshPart
from gdfe_ros.mesh.outside import Outside
from gdfe_ros.mesh.subset import join
from gdfe_ros.mesh.touching import Touching


def assemble(parts: Mapping[str, MeshPart]) -> HexMesh:
    """Return one mesh of all parts, in their order; vertices at the same place stay separate.

    Sets with the same name are united, and the parts are available by name in `Mesh.parts`. If one part has a skin, the
    boundary faces of the parts without a skin are added to it.

    Args:
        parts: dict from name to mesh with its pose; ``first_vertex`` and ``first_cell`` are set here.
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
