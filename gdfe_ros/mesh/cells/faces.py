# SPDX-License-Identifier: Apache-2.0
"""Faces of cells: the boundary and its orientation, and rows of cells through opposite faces."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

#: Local vertices of the six faces of a VTK hexahedron, counter-clockwise seen from outside the cell.
HEX_FACES = np.array(
    [[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]], dtype=np.int32
)
#: Local vertices of the twelve edges of a VTK hexahedron.
HEX_EDGES = np.array(
    [[0, 1], [1, 2], [3, 2], [0, 3], [4, 5], [5, 6], [7, 6], [4, 7], [0, 4], [1, 5], [2, 6], [3, 7]], dtype=np.int32
)


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces, and the cell to which each face belongs.

    Attributes:
        quads: vertex ids, int32, normals out of the owning cell. Faces of hexahedra have the shape (q, 4), in VTK's
            quad order. Faces of quadratic tetrahedra have the shape (q, 6): three corners, then the nodes on the edges
            01, 12, 20.
        cells: owning cell of each face, shape (q,), int32.
        crowded: cells with a face that belongs to three or more cells, sorted, int32; empty for a sound mesh.
        folded: cells that overlap a neighbour (both lie on the same side of their common face), or list the corners of
            this face in another order, sorted, int32; empty for a sound mesh without inverted cells.
    """

    quads: NDArray[np.int32]
    cells: NDArray[np.int32]
    crowded: NDArray[np.int32]
    folded: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))


def boundary_faces(cells: NDArray[np.int32], table: NDArray[np.int32] = HEX_FACES) -> Faces:
    """Return the faces that belong to exactly one cell.

    Args:
        cells: vertex ids, shape (m, c), in VTK's order.
        table: local vertices of the faces of a cell, one row a face, as in `Faces`.

    Returns:
        The boundary in the order of the cells (deterministic).
    """
    faces = cells[:, table].reshape(-1, table.shape[1])
    owners = np.repeat(np.arange(len(cells), dtype=np.int32), len(table))
    group, count = group_faces(corners_of(faces))
    sharing = count[group]
    single = sharing == 1
    return Faces(
        quads=np.ascontiguousarray(faces[single]),
        cells=owners[single],
        crowded=np.unique(owners[sharing > 2]),
        folded=find_folded_cells(corners_of(faces), group, owners),
    )


def corners_of(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the corners of faces: all four of quads, the first three of six-node faces."""
    return faces if faces.shape[1] == 4 else faces[:, :3]


def find_folded_cells(
    corners: NDArray[np.int32], group: NDArray[np.integer], owners: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Return the sorted cells, int32, that overlap a neighbour or list the corners of the common face in another order.

    Each cell lists the corners of a face counter-clockwise seen from outside. Two cells on opposite sides of the face
    thus list them in opposite directions. If the directions are equal, both cells are on the same side and overlap.

    Args:
        corners: corners of the faces, shape (q, 3) or (q, 4).
        group: number of the group of each face, shape (q,); the faces of a group have the same corners.
        owners: cell of each face, shape (q,).
    """
    order = np.argsort(group, kind="stable")
    first = np.flatnonzero(np.bincount(group)[group[order[:-1]]] == 2) if len(order) else order
    first = first[group[order[first]] == group[order[first + 1]]]
    one, other = order[first], order[first + 1]
    least = [np.argmin(corners[side], axis=1)[:, None] for side in (one, other)]
    width = np.arange(corners.shape[1])
    forth = np.take_along_axis(corners[one], (least[0] + width) % len(width), axis=1)
    back = np.take_along_axis(corners[other], (least[1] - width) % len(width), axis=1)
    wrong = (forth != back).any(axis=1)
    return np.unique(np.concatenate([owners[one[wrong]], owners[other[wrong]]]))


def group_faces(corners: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Group the faces that have the same corners in any order.

    Args:
        corners: vertex ids, shape (q, 3) or (q, 4).

    Returns:
        Group number of each face, shape (q,), and number of faces in each group, shape (groups,).
    """
    rows = np.sort(corners, axis=1).astype(np.int64)
    span = int(rows.max(initial=0)) + 1
    first, second = rows[:, 0] * span + rows[:, 1], rows[:, 2] * span + rows[:, -1]
    order = np.lexsort((second, first))
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (np.diff(first[order]) != 0) | (np.diff(second[order]) != 0)
    group = np.empty(len(rows), dtype=np.int64)
    group[order] = np.cumsum(new) - 1
    return group, np.bincount(group)


def enclosed_volume(vertices: NDArray[np.float64], quads: NDArray[np.int32]) -> float:
    """Return the volume inside a closed surface of bilinear quads [m^3], positive for outward normals.

    It is the mean over the two divisions of each quad into triangles; this is exact for a bilinear patch.

    Args:
        vertices: positions [m], shape (n, 3).
        quads: vertex ids, shape (q, 4), VTK quad order.
    """
    if len(quads) == 0:
        return 0.0
    a, b, c, d = np.moveaxis(vertices[quads] - vertices[quads[0, 0]], 1, 0)
    cuts = ((a, b, c), (a, c, d), (a, b, d), (b, c, d))
    return float(sum(np.einsum("ij,ij", p, np.cross(q, r)) for p, q, r in cuts) / 12)


def reverse(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return faces (q, 4) or (q, 6) with the opposite orientation."""
    return np.ascontiguousarray(faces[:, ::-1] if faces.shape[1] == 4 else faces[:, [0, 2, 1, 5, 4, 3]])


def vertex_pieces(cells: NDArray[np.integer], count: int) -> NDArray[np.int32]:
    """Return the number (from 0) of each vertex's connected piece, shape (count,), int32.

    Each row of ``cells`` (m, c) connects its vertices. Pieces are numbered in the order of their first vertices.
    """
    row, column = np.repeat(cells[:, 0], cells.shape[1] - 1), cells[:, 1:].ravel()
    graph = coo_array((np.ones(len(row), dtype=np.int8), (row, column)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int32)


def cells_across(
    cells: NDArray[np.int32], material: NDArray[np.int32], straight: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Count the cells in the three rows through each cell, one row along each of its axes.

    A row continues from a cell to its neighbour through opposite faces.

    Args:
        cells: (m, 8) corners, VTK order.
        material: (m,) index of each cell's material; a row ends where the material changes.
        straight: (m,) whether a cell is a parallelepiped; a row with a cell of another shape is not counted.

    Returns:
        Numbers of cells (m, 3), int32, the cell itself included. The number is 1 for a row that is not counted. For a
        row that closes into a ring it is the number of cells in the ring.
    """
    count = len(cells)
    group, sharing = group_faces(cells[:, HEX_FACES].reshape(-1, 4))
    inner = np.flatnonzero(sharing[group] == 2)
    # Each row has both faces of a pair; face 6 e + f lies across axis f // 2 of cell e.
    pairs = inner[np.argsort(group[inner], kind="stable")].reshape(-1, 2)
    pairs = pairs[material[pairs[:, 0] // 6] == material[pairs[:, 1] // 6]]
    row = vertex_pieces(3 * (pairs // 6) + pairs % 6 // 2, 3 * count)
    bent = np.bincount(row, weights=np.repeat(~straight, 3)) > 0.0
    return np.where(bent, 1, np.bincount(row))[row].reshape(count, 3).astype(np.int32)
