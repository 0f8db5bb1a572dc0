# SPDX-License-Identifier: Apache-2.0
"""Material points: fixed trilinear weights of the eight corners of the cell around each point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.hexmesh import HexMesh
from gdfe_ros.mesh.operators import reference_coordinates, trilinear_weights

SLACK = 1e-5
"""Distance outside of a cell, in its reference coordinates -1 .. 1, at which a point still counts as on its face."""
NEIGHBOURS = 64


@dataclass(frozen=True, eq=False)
class Embedding:
    """Points that move with the body.

    Attributes:
        corners: (p, 8) int32 vertices of the cell around each point; (p, 1) for points that are vertices.
        weights: (p, 8) or (p, 1) float64 trilinear weights, each row sums to one.
    """

    corners: NDArray[np.int32]
    weights: NDArray[np.float64]

    @classmethod
    def of_vertices(cls, vertices: NDArray[np.int32]) -> Embedding:
        """Return vertices (p,) as points."""
        return cls(vertices[:, None], np.ones((len(vertices), 1)))

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (p, 3) [m] of the points for vertices at ``positions`` (n, 3) [m]."""
        return np.einsum("pa,pai->pi", self.weights, positions[self.corners])


def embed(mesh: HexMesh, points: ArrayLike, *, what: str) -> Embedding:
    """Find the cell and the weights of each point (p, 3) [m].

    Args:
        mesh: the body at rest.
        points: coordinates [m]; on a face shared by cells the weights are the same from either side.
        what: name of the points in an error.

    Raises:
        MeshError: a point lies outside of the body; every such point is named with the nearest point of the body.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    corners = mesh.vertices[mesh.cells]
    tree = cKDTree(mesh.centroids)
    _, nearest = tree.query(points, k=min(NEIGHBOURS, mesh.n_cells))
    cells = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), 8))
    defects = []
    for i, candidates in enumerate(np.atleast_2d(nearest.reshape(len(points), -1))):
        reference = reference_coordinates(points[i], corners[candidates])
        beyond = np.abs(reference).max(axis=1)
        best = int(np.argmin(beyond))
        weights[i] = trilinear_weights(np.clip(reference[best], -1.0, 1.0))
        cells[i] = candidates[best]
        if not beyond[best] <= 1.0 + SLACK:
            found = ", ".join(f"{value:.4g}" for value in weights[i] @ corners[cells[i]])
            given = ", ".join(f"{value:.4g}" for value in points[i])
            defects.append(f"point {i} at ({given}) m lies outside of the body; the body is near ({found}) m")
    if defects:
        raise MeshError(what, defects)
    return Embedding(np.ascontiguousarray(mesh.cells[cells], dtype=np.int32), weights)
