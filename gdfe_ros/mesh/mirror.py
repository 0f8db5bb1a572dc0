# SPDX-License-Identifier: Apache-2.0
"""Reflection of a mesh at a coordinate plane of its own frame."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.filling import Filling
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.outside import Outside
from gdfe_ros.mesh.touching import Touching

ACROSS = {8: np.array([1, 0, 3, 2, 5, 4, 7, 6]), 10: np.array([0, 2, 1, 3, 6, 5, 4, 7, 9, 8])}
"""Dict from the number of nodes of a cell to the node order of the reflected cell. A hexahedron is reversed in xi. In a
tetrahedron the second and the third corner are exchanged. The reflected cell then has a positive volume."""
_Surface = TypeVar("_Surface", Outside, Touching)
_BACK = np.array([-1.0, 1.0, 1.0])


def mirrored(mesh: Mesh, axis: int) -> Mesh:
    """Return a mesh reflected at the plane through the origin that is perpendicular to an axis.

    Vertices, cells and sets keep their numbers. The nodes of each cell, and of each face of its skin, change their
    order. Cells thus keep a positive volume, and the normals of faces point out of the material.

    Args:
        mesh: a single mesh, not an assembly.
        axis: 0, 1 or 2 for x, y or z.
    """
    signs = np.ones(3)
    signs[axis] = -1.0
    filling = mesh.filling
    if filling is not None:
        filling = Filling(filling.share, filling.centre * _BACK, filling.spread)
    skin = None if mesh.skin is None else _reversed(mesh.skin)
    touching = None if mesh.touching is None else replace(_reversed(mesh.touching), surface=skin)
    return replace(
        mesh,
        vertices=mesh.vertices * signs,
        cells=mesh.cells[:, ACROSS[mesh.nodes]],
        filling=filling,
        skin=skin,
        touching=touching,
    )


def _reversed(surface: _Surface) -> _Surface:
    """Return a surface whose faces have the opposite orientation."""
    faces: NDArray[np.int32] = np.ascontiguousarray(surface.faces[:, ::-1])
    return replace(surface, faces=faces)
