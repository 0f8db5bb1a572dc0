# SPDX-License-Identifier: Apache-2.0
"""Material points: each point is a weighted mean, with fixed weights, of the vertices of the cell around it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from gdfe_ros.errors import MeshError, show_point
from gdfe_ros.mesh.cells.filling import reference_coordinates, trilinear_weights
from gdfe_ros.mesh.cells.tetrahedra import barycentric, quadratic_weights
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.tetmesh import TetMesh

SLACK = 1e-5
"""Largest distance outside of a cell at which a point still counts as on the cell's face, in the cell's reference
coordinates (-1 .. 1) or barycentric coordinates.
"""
HALF_A_CELL = {8: 1.0, 10: 0.5}
"""Half the size of a cell with 8 or 10 nodes, in reference or barycentric coordinates."""
NEIGHBOURS = 64
"""Number of candidate cells for a point: the cells with the nearest centroids."""


@dataclass(frozen=True, eq=False)
class Embedding:
    """Material points, which move with the body.

    Attributes:
        corners: (p, c) int32 vertices of the cell around each point; (p, 1) for points that are vertices.
        weights: (p, c) or (p, 1) float64 weights of these vertices; each row sums to one, or is zero.
        anchors: (p, 3) positions [m] of points that are fixed in the world, whose weights are zero; zero for points of
            the body. None if all points belong to the body.
        moved: largest distance [m] by which a point outside of the body was moved onto it.
    """

    corners: NDArray[np.int32]
    weights: NDArray[np.float64]
    anchors: NDArray[np.float64] | None = None
    moved: float = 0.0

    @classmethod
    def of_vertices(cls, vertices: NDArray[np.int32]) -> Embedding:
        """Return the material points at given vertices (p,)."""
        return cls(vertices[:, None], np.ones((len(vertices), 1)))

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (p, 3) [m] of the points for vertices at ``positions`` (n, 3) [m]."""
        places = np.einsum("pa,pai->pi", self.weights, positions[self.corners])
        return places if self.anchors is None else places + self.anchors

    def seen_from(self, origin: NDArray[np.float64]) -> Embedding:
        """Return the points for positions relative to ``origin`` (3,) [m]."""
        if self.anchors is None:
            return self
        return replace(self, anchors=self.anchors - (1.0 - self.weights.sum(axis=1))[:, None].round() * origin)


def embed(mesh: Mesh, points: ArrayLike, *, what: str, reach: float = SLACK) -> Embedding:
    """Return the material points at given positions in the undeformed body.

    Args:
        mesh: the undeformed body.
        points: positions (p, 3) [m]; a point on the common face of two cells has the same weights in both.
        what: name of the points in an error.
        reach: largest distance outside of a cell, as `SLACK`, from which a point is moved onto the cell.

    Raises:
        MeshError: a point is outside of the body; the error names every such point and a point of the body near it.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    corners = mesh.vertices[mesh.cells]
    locate = _in_tetrahedra if isinstance(mesh, TetMesh) else _in_hexahedra
    tree = cKDTree(mesh.centroids)
    _, nearest = tree.query(points, k=min(NEIGHBOURS, mesh.n_cells))
    cells = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), mesh.nodes))
    defects, moved = [], 0.0
    for i, candidates in enumerate(np.atleast_2d(nearest.reshape(len(points), -1))):
        beyond, shares = locate(points[i], corners[candidates])
        best = int(np.argmin(beyond))
        weights[i], cells[i] = shares[best], candidates[best]
        if SLACK < beyond[best] <= reach:
            moved = max(moved, float(np.linalg.norm(weights[i] @ corners[cells[i]] - points[i])))
        elif not beyond[best] <= SLACK:
            given, found = show_point(points[i]), show_point(weights[i] @ corners[cells[i]])
            defects.append(f"point {i} at {given} m lies outside of the body; the body is near {found} m")
    if defects:
        raise MeshError(what, defects)
    return Embedding(np.ascontiguousarray(mesh.cells[cells], dtype=np.int32), weights, moved=moved)


def _in_hexahedra(
    point: NDArray[np.float64], corners: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far (k,) a point is outside of cells with corners (k, 8, 3), and the corners' weights (k, 8).

    The distance is in reference coordinates, negative inside. The weights are those of the nearest point in the cell.
    """
    reference = reference_coordinates(point, corners)
    return np.abs(reference).max(axis=1) - 1.0, trilinear_weights(np.clip(reference, -1.0, 1.0))


def _in_tetrahedra(
    point: NDArray[np.float64], nodes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far (k,) a point is outside of cells with nodes (k, 10, 3), and the nodes' weights (k, 10).

    The distance is in barycentric coordinates, negative inside. The weights belong to the point if it is inside,
    otherwise to a nearby point of the cell.
    """
    place = barycentric(point, nodes)
    inside = np.clip(place, 0.0, None)
    return -place.min(axis=1), quadratic_weights(inside / inside.sum(axis=1, keepdims=True))
