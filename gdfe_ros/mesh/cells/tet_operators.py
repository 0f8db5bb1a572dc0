# SPDX-License-Identifier: Apache-2.0
"""Shape operators of quadratic tetrahedra, computed once (docs/theory/tetrahedra.md)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.cells.operators import with_rows
from gdfe_ros.mesh.cells.tetrahedra import POINTS, quadratic_slopes


class TetOperators(NamedTuple):
    """Constant operators of every element.

    Attributes:
        cells: (m, 10) int32 nodes, VTK order.
        volume: (m,) float64 [m^3].
        weight: (m, 4) float64 [m^3], volume of each integration point; the sum is ``volume``.
        inverse: (m, 4, 3, 3) float64 [1/m], inverse of dX/dxi at the integration points.
        gradient: (m, 10, 3) float64 [1/m], volume average of the shape functions' gradients.
        corner_ratio: (m, 4) float64 [1/m^3], 1 / det(dX/dxi) at each corner.
    """

    cells: NDArray[np.int32]
    volume: NDArray[np.float64]
    weight: NDArray[np.float64]
    inverse: NDArray[np.float64]
    gradient: NDArray[np.float64]
    corner_ratio: NDArray[np.float64]


def tet_operators(vertices: NDArray[np.float64], cells: NDArray[np.int32]) -> TetOperators:
    """Return the operators of all elements from undeformed vertices (n, 3) [m] and cells (m, 10)."""
    nodes = vertices[cells]
    jacobian = np.einsum("eai,gaj->egij", nodes, quadratic_slopes(POINTS))
    weight, inverse = np.linalg.det(jacobian) / 24.0, np.linalg.inv(jacobian)
    volume = weight.sum(axis=1)
    local = gradients(inverse)
    return TetOperators(
        np.ascontiguousarray(cells, dtype=np.int32),
        volume,
        weight,
        np.ascontiguousarray(inverse),
        np.ascontiguousarray(np.einsum("eg,egai->eai", weight, local) / volume[:, None, None]),
        1.0 / np.linalg.det(corner_jacobians(nodes)),
    )


def grow_tet_operators(shape: TetOperators, cells: NDArray[np.intp], stretch: NDArray[np.float64]) -> TetOperators:
    """Return the operators of cells whose rest shape is mapped by G; arguments as for `grow_operators`."""
    inverse, ratio = np.linalg.inv(stretch), np.linalg.det(stretch)
    return shape._replace(
        volume=with_rows(shape.volume, cells, shape.volume[cells] * ratio),
        weight=with_rows(shape.weight, cells, shape.weight[cells] * ratio[:, None]),
        inverse=with_rows(shape.inverse, cells, shape.inverse[cells] @ inverse[:, None]),
        gradient=with_rows(shape.gradient, cells, shape.gradient[cells] @ inverse),
        corner_ratio=with_rows(shape.corner_ratio, cells, shape.corner_ratio[cells] / ratio[:, None]),
    )


def gradients(inverse: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return dN_a/dX_i (m, 4, 10, 3) [1/m] at the integration points; ``inverse`` (m, 4, 3, 3) is dxi/dX [1/m]."""
    return np.einsum("gak,egki->egai", quadratic_slopes(POINTS), inverse)


def corner_jacobians(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return dX/dxi (m, 4, 3, 3) [m] at the corners of cells with ``nodes`` (m, 10, 3) [m]."""
    return np.einsum("eai,caj->ecij", nodes, quadratic_slopes(np.eye(4)))
