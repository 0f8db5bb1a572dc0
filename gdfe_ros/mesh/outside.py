# SPDX-License-Identifier: Apache-2.0
"""Surface that is drawn for a body: the outer faces of its cells, or a skin attached to the cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.errors import MeshError, show_point
from gdfe_ros.mesh.cells.faces import Faces
from gdfe_ros.mesh.cells.filling import SETTLED, reference_coordinates, trilinear_weights
from gdfe_ros.mesh.cells.tetrahedra import facets
from gdfe_ros.mesh.surfaces.shells import cone_volumes
from gdfe_ros.mesh.surfaces.surface_edges import refine

NEAR = 12
"""Number of cells with the nearest centroids that are tried as carriers of a skin point."""
WITHIN = 1.0 - 1e-9
"""A point is certainly inside a cell, and in no other cell, if all its reference coordinates are below this in
magnitude.
"""
REACH = 3.001
"""Largest magnitude of a carried point's reference coordinates: one edge length outside of its cell. That far outside
is the far end of a sliver whose material moved to the cell (`gather_slivers`).
"""


@dataclass(frozen=True, eq=False)
class Outside:
    """A surface that moves with a body: faces between k points, each of which is carried by mesh vertices.

    Attributes:
        faces: (f, 3 or 4) int32 indices of points.
        cells: (f,) int32 cell of each face; the face is drawn in the colour of this cell.
        corners: (k, 1 or 8) int32 vertices of the mesh that carry each point.
        weights: (k, 1 or 8) weights of these vertices, which sum to one for each point.
    """

    faces: NDArray[np.int32]
    cells: NDArray[np.int32]
    corners: NDArray[np.int32]
    weights: NDArray[np.float64]

    @classmethod
    def of_faces(cls, faces: Faces) -> Outside:
        """Return boundary faces as a surface whose points are mesh vertices; a six-node face becomes four triangles."""
        drawn, owners = faces.quads, faces.cells
        if drawn.shape[1] == 6:
            drawn, owners = facets(drawn), np.repeat(owners, 4)
        ids, local = np.unique(drawn, return_inverse=True)
        weights = np.ones((len(ids), 1))
        return cls(local.reshape(drawn.shape).astype(np.int32), owners, ids[:, None].astype(np.int32), weights)

    @classmethod
    def join(cls, outsides: Sequence[Outside], vertices: Sequence[int], cells: Sequence[int]) -> Outside:
        """Return several surfaces as one, with triangles as faces and eight vertices for each point.

        Args:
            outsides: the surface of each mesh of an assembly.
            vertices: index of each mesh's first vertex in the assembly.
            cells: index of each mesh's first cell in the assembly.
        """
        found, points = [], 0
        for each, first_vertex, first_cell in zip(outsides, vertices, cells, strict=False):
            corners, weights, owners = each.corners, each.weights, each.cells
            if not each.skin:
                corners, weights = np.repeat(corners, 8, axis=1), np.eye(1, 8).repeat(len(corners), axis=0)
                owners = np.repeat(owners, 2)
            found.append((each.triangles + points, owners + first_cell, corners + first_vertex, weights))
            points += len(corners)
        faces, owners, corners, weights = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
        return cls(faces.astype(np.int32), owners.astype(np.int32), corners.astype(np.int32), weights)

    @property
    def skin(self) -> bool:
        """Whether this surface is a skin: its points are carried by eight vertices each."""
        return self.corners.shape[1] > 1

    @property
    def triangles(self) -> NDArray[np.int32]:
        """The faces as triangles (t, 3); the triangles of one face are consecutive."""
        return self.faces if self.faces.shape[1] == 3 else self.faces[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)

    def at(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return vertex values, such as positions (n, 3) [m], at the points (k, 3)."""
        if not self.skin:
            return values[self.corners[:, 0]]
        return np.einsum("ka,ka...->k...", self.weights, values[self.corners])

    def average(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values at the points (k,): at each point the mean of ``values`` (m,) of the cells of its faces."""
        points, count = self.faces.ravel(), len(self.corners)
        total = np.bincount(points, weights=np.repeat(values[self.cells], self.faces.shape[1]), minlength=count)
        return total / np.maximum(np.bincount(points, minlength=count), 1)


def carry_skin(
    vertices: NDArray[np.float64], cells: NDArray[np.int32], points: NDArray[np.float64], triangles: NDArray[np.int64]
) -> Outside:
    """Return a triangle surface as a skin: each point is attached to the cell that contains it, or to the nearest cell.

    Triangles with longer edges than the cells are divided, because they would stay flat when the cells bend.

    Args:
        vertices: vertices of the undeformed mesh (n, 3) [m].
        cells: vertex ids of the corners of each cell (m, 8).
        points: points of the surface (k, 3) [m].
        triangles: ids of the points of each triangle (t, 3).

    Raises:
        MeshError: points are too far outside of the cells.
    """
    corners = vertices[cells]
    edge = float(np.linalg.norm(corners[:, [1, 3, 4]] - corners[:, :1], axis=2).mean())
    points, triangles = refine(points, triangles, edge)
    best, weights = hang(vertices, cells, points)
    if cone_volumes(points, triangles).sum() < 0.0:
        triangles = triangles[:, ::-1]
    carriers = np.ascontiguousarray(cells[best], dtype=np.int32)
    owners = best[triangles[:, 0]].astype(np.int32)
    return Outside(triangles.astype(np.int32), owners, carriers, weights)


def hang(
    vertices: NDArray[np.float64], cells: NDArray[np.int32], points: NDArray[np.float64], *, within: float = SETTLED
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the cell (k,) that carries each of ``points`` (k, 3) [m], and the weights (k, 8) of its corners.

    The carrying cell contains the point, or is the nearest of the candidates (`NEAR`). The distance is measured by the
    largest magnitude of the point's reference coordinates; of equally near cells, the lowest index counts.
    ``vertices`` and ``cells`` are as for `carry_skin`; ``within`` is as for `reference_coordinates`.

    Raises:
        MeshError: points are too far outside of the cells.
    """
    corners = vertices[cells]
    _, near = cKDTree(corners.mean(axis=1)).query(points, k=min(NEAR, len(cells)))
    near = near.reshape(len(points), -1)
    best, beyond, place = near[:, 0].copy(), np.full(len(points), np.inf), np.empty((len(points), 3))
    sought = np.arange(len(points))
    for candidates in near.T:
        cell = candidates[sought]
        found = reference_coordinates(points[sought], corners[cell], within=within)
        away = np.abs(found).max(axis=1)
        alike = np.abs(away - beyond[sought]) <= 1.0 - WITHIN  # equal up to rounding, as on a common face
        nearer = np.where(alike, cell < best[sought], away < beyond[sought])
        chosen = sought[nearer]
        best[chosen], beyond[chosen], place[chosen] = cell[nearer], away[nearer], found[nearer]
        sought = sought[~(beyond[sought] < WITHIN)]
        if len(sought) == 0:
            break
    far = ~(beyond <= REACH)
    if far.any():
        raise MeshError("skin", [_too_far(points, far, corners[best], vertices)])
    return best, trilinear_weights(place)


def _too_far(
    points: NDArray[np.float64], far: NDArray[np.bool_], corners: NDArray[np.float64], vertices: NDArray[np.float64]
) -> str:
    """Return the text of a defect about the points that are ``far`` from their cells.

    ``corners`` (k, 8, 3) [m] are the corners of each point's nearest cell, ``vertices`` (n, 3) [m] those of all cells.
    """
    away = np.where(far, cKDTree(vertices).query(points)[0], 0.0)
    worst = int(np.argmax(away))
    edge = np.linalg.norm(corners[worst, 1] - corners[worst, 0])
    return (
        f"{far.sum()} of {len(points)} vertices lie far outside of the cells; the farthest, at "
        f"{show_point(points[worst])} m, is {away[worst]:.3g} m away from their vertices; allowed: the edge of a cell, "
        f"{edge:.3g} m there; remedy: check scale and place of the file, use cells of another size, or make a sharp "
        "tip blunt"
    )
