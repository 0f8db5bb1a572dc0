# SPDX-License-Identifier: Apache-2.0
"""Material points: fixed weights of the vertices of the cell around each point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.tetmesh import TetMesh
from gdfe_ros.mesh.tetrahedra import barycentric, quadratic_weights
from gdfe_ros.mesh.trilinear import reference_coordinates, trilinear_weights

SLACK = 1e-5
"""A point counts as on a cell's face if it is outside by at most this, in the cell's reference coordinates (-1 .. 1, or
barycentric).
"""
NEIGHBOURS = 64
"""Number of cells, those with the nearest centres, that are searched for the cell around a point."""


@dataclass(frozen=True, eq=False)
class Embedding:
    """Points that move with the body.

    Attributes:
        corners: (p, c) int32 vertices of the cell around each point; (p, 1) for points that are vertices.
        weights: (p, c) or (p, 1) float64 weights, each row sums to one.
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


def embed(mesh: Mesh, points: ArrayLike, *, what: str) -> Embedding:
    """Find the cell and the weights of each point (p, 3) [m].

    Args:
        mesh: the undeformed body.
        points: coordinates [m]; on a face between cells the weights are the same from either side.
        what: name of the points in an error.

    Raises:
        MeshError: a point lies outside of the body; every such point is named with the nearest point of the body.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    corners = mesh.vertices[mesh.cells]
    locate = _in_tetrahedra if isinstance(mesh, TetMesh) else _in_hexahedra
    tree = cKDTree(mesh.centroids)
    _, nearest = tree.query(points, k=min(NEIGHBOURS, mesh.n_cells))
    cells = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), mesh.nodes))
    defects = []
    for i, candidates in enumerate(np.atleast_2d(nearest.reshape(len(points), -1))):
        beyond, shares = locate(points[i], corners[candidates])
        best = int(np.argmin(beyond))
        weights[i], cells[i] = shares[best], candidates[best]
        if not beyond[best] <= SLACK:
            found = ", ".join(f"{value:.4g}" for value in weights[i] @ corners[cells[i]])
            given = ", ".join(f"{value:.4g}" for value in points[i])
            defects.append(f"point {i} at ({given}) m lies outside of the body; the body is near ({found}) m")
    if defects:
        raise MeshError(what, defects)
    return Embedding(np.ascontiguousarray(mesh.cells[cells], dtype=np.int32), weights)


def _in_hexahedra(
    point: NDArray[np.float64], corners: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far (k,) a point lies outside of cells (k, 8, 3), in reference coordinates, and its weights (k, 8)."""
    reference = reference_coordinates(point, corners)
    return np.abs(reference).max(axis=1) - 1.0, trilinear_weights(np.clip(reference, -1.0, 1.0))


def _in_tetrahedra(
    point: NDArray[np.float64], nodes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far (k,) a point lies outside of cells (k, 10, 3), in barycentric coordinates, and weights (k, 10)."""
    place = barycentric(point, nodes)
    inside = np.clip(place, 0.0, None)
    return -place.min(axis=1), quadratic_weights(inside / inside.sum(axis=1, keepdims=True))
