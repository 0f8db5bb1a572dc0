# SPDX-License-Identifier: Apache-2.0
"""Reflection of a mesh at a plane of its own frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.filling import Filling
from gdfe_ros.mesh.hexmesh import HexMesh
from gdfe_ros.mesh.outside import Outside

ACROSS = np.array([1, 0, 3, 2, 5, 4, 7, 6])
"""Corner of a cell with the opposite xi. A cell whose corners are exchanged so has a positive volume again."""
_BACK = np.array([-1.0, 1.0, 1.0])


def mirrored(mesh: HexMesh, axis: int) -> HexMesh:
    """Return a mesh reflected at the plane through the origin that is perpendicular to an axis.

    Vertices, cells and sets keep their numbers. The corners of each cell, and of each face of its skin, change their
    order, so that cells are not inverted and faces look out of the material.

    Args:
        mesh: of one piece, not assembled of parts.
        axis: 0, 1 or 2.
    """
    signs = np.ones(3)
    signs[axis] = -1.0
    filling = mesh.filling
    if filling is not None:
        filling = Filling(filling.share, filling.centre * _BACK, filling.spread)
    skin = None if mesh.skin is None else _reversed(mesh.skin)
    touching = None if mesh.touching is None else replace(mesh.touching, surface=skin)
    return replace(
        mesh,
        vertices=mesh.vertices * signs,
        cells=mesh.cells[:, ACROSS],
        filling=filling,
        skin=skin,
        touching=touching,
    )


def _reversed(outside: Outside) -> Outside:
    faces: NDArray[np.int32] = np.ascontiguousarray(outside.faces[:, ::-1])
    return replace(outside, faces=faces)
