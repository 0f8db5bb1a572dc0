# SPDX-License-Identifier: Apache-2.0
"""Meshes made from other meshes: selection of cells, merging of coincident vertices, joining."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gdfe_ros.mesh.filling import Filling
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.quality import COINCIDENT, coincident_pairs

_BARE: Mapping[str, Any] = {"skin": None, "touching": None, "parts": {}}
"""Dict from each field that is lost if cells or vertices are removed, merged or joined, to its empty value."""


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


def merge_vertices(mesh: Mesh, tolerance: float | None = None) -> Mesh:
    """Return the mesh with coincident vertices merged; the first vertex of each group gives the position.

    Args:
        mesh: a mesh with finite vertices.
        tolerance: distance [m] up to which vertices coincide; 1e-7 of the mesh size by default.
    """
    limit = COINCIDENT * mesh.size if tolerance is None else tolerance
    first, second = coincident_pairs(mesh.vertices, limit).T
    n = mesh.n_vertices
    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(n, n))
    _, group = connected_components(graph, directed=False)
    _, leaders, number = np.unique(group, return_index=True, return_inverse=True)
    order = np.argsort(leaders)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    new = rank[number]
    return replace(
        mesh,
        vertices=mesh.vertices[leaders[order]],
        cells=new[mesh.cells],
        cell_sets=mesh.cell_sets,
        vertex_sets={name: new[ids] for name, ids in mesh.vertex_sets.items()},
        filling=mesh.filling,
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
        cell_sets=_united([mesh.cell_sets for mesh in meshes], cell_start),
        vertex_sets=_united([mesh.vertex_sets for mesh in meshes], vertex_start),
        filling=Filling.joined([mesh.filling or Filling.whole(mesh.n_cells) for mesh in meshes]) if filled else None,
        **_BARE,
    )


def _united(sets: list[Mapping[str, NDArray[np.int32]]], starts: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    names = dict.fromkeys(name for some in sets for name in some)
    return {
        name: np.concatenate([some[name] + start for some, start in zip(sets, starts, strict=False) if name in some])
        for name in names
    }
