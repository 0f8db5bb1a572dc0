# SPDX-License-Identifier: Apache-2.0
"""Values of cells on the faces of the drawn surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.outside import Outside


def face_values(outside: Outside, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values on the faces (f,) of a surface, from ``values`` (m,) of the cells.

    The faces of cells have the values of their cells. A skin has many faces for each cell, so that its values would
    jump from cell to cell. There, a point has the mean value of its faces, and a face the mean value of its points.
    """
    own = values[outside.cells]
    if not outside.skin:
        return own
    points, sides = outside.faces.ravel(), outside.faces.shape[1]
    at_points = np.bincount(points, weights=np.repeat(own, sides)) / np.maximum(np.bincount(points), 1)
    return at_points[outside.faces].mean(axis=1)
