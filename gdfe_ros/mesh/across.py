# SPDX-License-Identifier: Apache-2.0
"""Number of cells in a row that continues from cell to cell through opposite faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.faces import HEX_FACES, group_faces, vertex_pieces


def cells_across(
    cells: NDArray[np.int32], material: NDArray[np.int32], straight: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Return the number of cells in the rows of each cell, one row along each of its three axes.

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
