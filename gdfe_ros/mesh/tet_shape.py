# SPDX-License-Identifier: Apache-2.0
"""Measures of the shape of quadratic tetrahedra: volume, scaled Jacobian, aspect ratio."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.tet_operators import corner_jacobians
from gdfe_ros.mesh.tetmesh import TetMesh
from gdfe_ros.mesh.tetrahedra import EDGES, quadratic_slopes, simplex_rule


def scaled_jacobians(mesh: TetMesh) -> NDArray[np.float64]:
    """Return the least scaled Jacobian over the four corners of each cell, shape (m,).

    At a corner whose edges have the tangent vectors a, b, c it is 2^(1/2) a . (b x c) / (|a| |b| |c|). It is 1 for a
    regular tetrahedron with straight edges, and <= 0 for a flat or inverted corner. At a corner with a tangent vector
    of zero length it is 0.
    """
    jacobian = corner_jacobians(mesh.vertices[mesh.cells])
    first, second, third = np.moveaxis(jacobian, 3, 0)
    volume = np.einsum("mci,mci->mc", first, np.cross(second, third))
    # The directions at corner c are G_j - G_c; the columns are G_j - G_0.
    whole = np.concatenate([np.zeros((*jacobian.shape[:2], 3, 1)), jacobian], axis=3)
    own = np.stack([whole[:, c] - whole[:, c, :, c, None] for c in range(4)], axis=1)
    lengths = np.linalg.norm(own, axis=2)
    lengths[:, np.arange(4), np.arange(4)] = 1.0
    scale = lengths.prod(axis=2)
    return np.divide(2.0**0.5 * volume, scale, out=np.zeros_like(volume), where=scale > 0.0).min(axis=1)


def aspect_ratios(mesh: TetMesh) -> NDArray[np.float64]:
    """Return the ratio of the largest to the smallest distance of two corners of each cell, shape (m,).

    It is inf if two corners coincide.
    """
    corners = mesh.vertices[mesh.cells[:, :4]]
    lengths = np.linalg.norm(corners[:, EDGES[:, 1]] - corners[:, EDGES[:, 0]], axis=2)
    shortest, longest = lengths.min(axis=1), lengths.max(axis=1)
    return np.divide(longest, shortest, out=np.full_like(longest, np.inf), where=shortest > 0)


def cell_volumes(mesh: TetMesh) -> NDArray[np.float64]:
    """Return the exact volume of each cell [m^3], shape (m,), negative for an inverted cell."""
    nodes, total = mesh.vertices[mesh.cells], np.zeros(mesh.n_cells)
    for place, weight in zip(*simplex_rule(2), strict=True):
        total += weight / 6.0 * np.linalg.det(np.einsum("eai,aj->eij", nodes, quadratic_slopes(place)))
    return total
