# SPDX-License-Identifier: Apache-2.0
"""Selections of triangles and contact points of a mesh's skin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.selection import (
    FACE_SLACK,
    AnyOf,
    BoxSelection,
    Face,
    SphereSelection,
    Where,
    Within,
    at_end,
    inside_of,
    part_of,
    united,
)
from gdfe_ros.mesh.touching import Touching


def select_skin(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the triangles (t, 3) int32 of a mesh's skin whose three points are selected; there may be none.

    A `Face` refers to the bounding box of the skin.

    Raises:
        MeshError: the selection is by ids, sets or the name of a mesh; these refer to cells and not to a skin.
    """
    if isinstance(where, AnyOf):
        return np.unique(np.concatenate([select_skin(mesh, place) for place in where.places]), axis=0)
    chosen = _chosen(mesh, mesh.skin.at(mesh.vertices), where)
    return mesh.skin.faces[chosen[mesh.skin.faces].all(axis=1)]


def select_touching(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the sorted indices of the selected contact points of a mesh's skin; there may be none.

    A `Face` refers to the bounding box of the skin.

    Raises:
        MeshError: the selection is by ids or sets, which refer to cells and not to a skin, or a mesh is unknown.
    """
    if isinstance(where, AnyOf):
        return united(select_touching(mesh, place) for place in where.places)
    if isinstance(where, Within):
        first, touching = sum(len(each.corners) for each in _before(mesh, where)), _part(mesh, where).touching
        if touching is None:
            return np.zeros(0, np.int32)
        count = len(touching.corners)
        own = np.arange(count) if where.where is None else select_touching(_part(mesh, where), where.where)
        return (own + first).astype(np.int32)
    points, ends = mesh.touching.at(mesh.vertices), mesh.outside.at(mesh.vertices)
    return np.flatnonzero(_chosen(mesh, np.concatenate([points, ends]), where)[: len(points)]).astype(np.int32)


def select_touching_faces(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the triangles (t, 3) int32 of contact points whose three points are selected; there may be none.

    In an `AnyOf`, a single one of its selections must contain all three.

    Raises:
        MeshError: as for `select_touching`.
    """
    faces, selected = mesh.touching.faces, False
    for place in where.places if isinstance(where, AnyOf) else (where,):
        selected = selected | np.isin(faces, select_touching(mesh, place)).all(axis=1)
    return faces[selected]


def _part(mesh: Mesh, where: Within) -> Mesh:
    return part_of(mesh, where.part).mesh


def _before(mesh: Mesh, where: Within) -> list[Touching]:
    """Return the contact points of the meshes before the one in which a selection is."""
    last = part_of(mesh, where.part).first_vertex
    before = [each.mesh.touching for each in mesh.parts.values() if each.first_vertex < last]
    return [each for each in before if each is not None]


def _chosen(mesh: Mesh, points: NDArray[np.float64], where: Where) -> NDArray[np.bool_]:
    """Return whether each of ``points`` (k, 3) [m] of a skin is selected."""
    match where:
        case Face(side):
            return at_end(points, side, FACE_SLACK * mesh.size)
        case BoxSelection() | SphereSelection():
            return inside_of(mesh, points, where)
        case _:
            raise MeshError(
                "the selection does not fit the skin",
                ["ids, sets and names of meshes are those of cells, not of a skin; allowed: face, box, sphere"],
            )
