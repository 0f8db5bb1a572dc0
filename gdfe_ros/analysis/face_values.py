# SPDX-License-Identifier: Apache-2.0
"""Values of cells on the faces of the drawn surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh import HexMesh


def face_values(mesh: HexMesh, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values on the faces (f,) of the drawn surface, from ``values`` (m,) of the cells.

    The faces of cells have the values of their cells. A skin has many faces for each cell, so that its values would
    jump from cell to cell. There, a vertex of the mesh has the mean value of its cells, and a face the mean value of
    its points, interpolated between the vertices and limited to the range of ``values``.
    """
    outside = mesh.outside
    if not outside.skin:
        return values[outside.cells]
    corners, sides, count = mesh.cells.ravel(), mesh.cells.shape[1], mesh.n_vertices
    sums = np.bincount(corners, weights=np.repeat(values, sides), minlength=count)
    at_vertices = sums / np.maximum(np.bincount(corners, minlength=count), 1)
    on_faces = outside.at(at_vertices)[outside.faces].mean(axis=1)
    return np.clip(on_faces, values.min(), values.max())
