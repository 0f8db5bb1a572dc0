# SPDX-License-Identifier: Apache-2.0
"""Meshes derived from other meshes: assemblies, meshes with fewer cells, merged vertices, mirror images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.cells.faces import vertex_pieces
from gdfe_ros.mesh.cells.filling import Filling
from gdfe_ros.mesh.mesh import HexMesh, Mesh, MeshPart
from gdfe_ros.mesh.outside import Outside
from gdfe_ros.mesh.quality import COINCIDENT, coincident_pairs
from gdfe_ros.mesh.touching import Touching


def assemble(parts: Mapping[str, MeshPart]) -> HexMesh:
    """Return one mesh of all parts, in their order; vertices at the same place stay separate.

    Sets with the same name are united, and the parts are available by name in `Mesh.parts`. If one part has a skin, the
    boundary faces of the parts without a skin are added to it.

    Args:
        parts: dict from name to mesh with its pose; ``first_vertex`` and ``first_cell`` are set here.
    """
    meshes = [part.place() for part in parts.values()]
    vertices = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)]).tolist()
    cells = np.cumsum([0, *(mesh.n_cells for mesh in meshes)]).tolist()
    numbered = {
        name: replace(part, first_vertex=first_vertex, first_cell=first_cell)
        for (name, part), first_vertex, first_cell in zip(parts.items(), vertices, cells, strict=False)
    }
    skin = None
    if any(mesh.skin is not None for mesh in meshes):
        skin = Outside.join([mesh.outside for mesh in meshes], vertices, cells)
    touching = [
        (mesh.touching, first_vertex, first_cell)
        for mesh, first_vertex, first_cell in zip(meshes, vertices, cells, strict=False)
        if mesh.touching is not None
    ]
    touching = Touching.join(touching) if touching else None
    return replace(join(*meshes), skin=skin, touching=touching, parts=numbered)


_BARE: Mapping[str, Any] = {"skin": None, "touching": None, "parts": {}}
"""Values of the fields of a mesh that become empty when cells or vertices are removed, merged or joined."""


def keep_cells(mesh: Mesh, keep: NDArray[np.bool_]) -> Mesh:
    """Return a mesh with some of the cells, and only the vertices that these cells use, both in their old order.

    Args:
        mesh: the mesh.
        keep: whether each cell is kept, bool, shape (m,).
    """
    cells = mesh.cells[keep]
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[cells] = True
    cell_number, vertex_number = np.cumsum(keep) - 1, np.cumsum(used) - 1
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        cells=vertex_number[cells],
        cell_sets={name: cell_number[ids[keep[ids]]] for name, ids in mesh.cell_sets.items()},
        vertex_sets={name: vertex_number[ids[used[ids]]] for name, ids in mesh.vertex_sets.items()},
        filling=None if mesh.filling is None else mesh.filling.of(keep),
        **_BARE,
    )


def merge_vertices(mesh: Mesh) -> Mesh:
    """Return the mesh with each group of coincident vertices merged into the first vertex of the group.

    Vertices are coincident if their distance is at most 1e-7 of the mesh's size.

    Args:
        mesh: a mesh with finite vertices.
    """
    pairs = coincident_pairs(mesh.vertices, COINCIDENT * mesh.size)
    number = vertex_pieces(pairs, mesh.n_vertices)
    first = np.unique(number, return_index=True)[1]
    return replace(
        mesh,
        vertices=mesh.vertices[first],
        cells=number[mesh.cells],
        vertex_sets={name: number[ids] for name, ids in mesh.vertex_sets.items()},
        **_BARE,
    )


def join(*meshes: Mesh) -> Mesh:
    """Return several meshes of one type as one mesh, in order.

    Sets with the same name are united. Vertices stay separate.
    """
    filled = any(mesh.filling is not None for mesh in meshes)
    vertex_start = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)])
    cell_start = np.cumsum([0, *(mesh.n_cells for mesh in meshes)])
    return replace(
        meshes[0],
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        cells=np.concatenate([mesh.cells + start for mesh, start in zip(meshes, vertex_start, strict=False)]),
        cell_sets=_unite([mesh.cell_sets for mesh in meshes], cell_start),
        vertex_sets=_unite([mesh.vertex_sets for mesh in meshes], vertex_start),
        filling=Filling.join([mesh.filling or Filling.whole(mesh.n_cells) for mesh in meshes]) if filled else None,
        **_BARE,
    )


def _unite(sets: list[Mapping[str, NDArray[np.int32]]], starts: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    names = dict.fromkeys(name for some in sets for name in some)
    return {
        name: np.concatenate([some[name] + start for some, start in zip(sets, starts, strict=False) if name in some])
        for name in names
    }


ACROSS = {8: np.array([1, 0, 3, 2, 5, 4, 7, 6]), 10: np.array([0, 2, 1, 3, 6, 5, 4, 7, 9, 8])}
"""Dict from the number of nodes of a cell to the node order of the reflected cell. A hexahedron is reversed in xi. In a
tetrahedron the second and the third corner are exchanged. The reflected cell then has a positive volume."""
_Surface = TypeVar("_Surface", Outside, Touching)
_BACK = np.array([-1.0, 1.0, 1.0])
"""Factors on a point's reference coordinates (xi, eta, zeta) that give its coordinates in the reflected hexahedron."""


def mirror(mesh: Mesh, axis: int) -> Mesh:
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
    skin = None if mesh.skin is None else _reverse(mesh.skin)
    touching = None if mesh.touching is None else replace(_reverse(mesh.touching), surface=skin)
    return replace(
        mesh,
        vertices=mesh.vertices * signs,
        cells=mesh.cells[:, ACROSS[mesh.nodes]],
        filling=filling,
        skin=skin,
        touching=touching,
    )


def _reverse(surface: _Surface) -> _Surface:
    """Return a surface whose faces have the opposite orientation."""
    faces: NDArray[np.int32] = np.ascontiguousarray(surface.faces[:, ::-1])
    return replace(surface, faces=faces)
