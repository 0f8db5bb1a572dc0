# SPDX-License-Identifier: Apache-2.0
"""What a body is shown by: the outer faces of its cells, or a skin that they carry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.faces import Faces
from gdfe_ros.mesh.operators import reference_coordinates, trilinear_weights

NEAR = 12
"""Cells about a point of a skin of which one carries it."""
REACH = 2.5
"""Farthest place of a carried point in its cell's reference coordinates: three quarters of an edge outside."""


@dataclass(frozen=True, eq=False)
class Outside:
    """Faces between points that move with a body.

    Attributes:
        faces: (f, 3 or 4) int32 numbers of points.
        cells: (f,) int32 cell whose value each face shows.
        corners: (k, 1 or 8) int32 vertices of the mesh that carry each point.
        weights: (k, 1 or 8) their weights, which sum to one.
    """

    faces: NDArray[np.int32]
    cells: NDArray[np.int32]
    corners: NDArray[np.int32]
    weights: NDArray[np.float64]

    @classmethod
    def of_faces(cls, faces: Faces) -> Outside:
        """Return the faces themselves, between vertices of the mesh."""
        ids, local = np.unique(faces.quads, return_inverse=True)
        weights = np.ones((len(ids), 1))
        return cls(local.reshape(-1, 4).astype(np.int32), faces.cells, ids[:, None].astype(np.int32), weights)

    @property
    def skin(self) -> bool:
        """Whether it is a skin."""
        return self.corners.shape[1] > 1

    @property
    def triangles(self) -> NDArray[np.int32]:
        """The faces as triangles, those of one face in a row (t, 3)."""
        return self.faces if self.skin else self.faces[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)

    def at(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what vertices have, as positions (n, 3) [m], at the points (k, 3)."""
        if not self.skin:
            return values[self.corners[:, 0]]
        return np.einsum("ka,ka...->k...", self.weights, values[self.corners])


def carry_skin(
    vertices: NDArray[np.float64],
    cells: NDArray[np.int32],
    points: NDArray[np.float64],
    triangles: NDArray[np.int64],
) -> Outside:
    """Hang a triangle surface on the cells: each of its points on the cell that it lies in, or is nearest to.

    Triangles with longer edges than the cells are divided, lest they stay flat where the cells bend.

    Args:
        vertices: of the mesh at rest (n, 3) [m].
        cells: their corners (m, 8).
        points: of the surface (k, 3) [m].
        triangles: between the points (t, 3).

    Raises:
        MeshError: points lie too far outside of the cells to move with them sensibly.
    """
    corners = vertices[cells]
    edge = float(np.linalg.norm(corners[:, [1, 3, 4]] - corners[:, :1], axis=2).mean())
    points, triangles = divide(points, triangles, edge)
    _, near = cKDTree(corners.mean(axis=1)).query(points, k=min(NEAR, len(cells)))
    near = near.reshape(len(points), -1)
    best, place = near[:, 0].copy(), np.full((len(points), 3), np.inf)
    for candidate in near.T:
        found = reference_coordinates(points, corners[candidate])
        closer = np.abs(found).max(axis=1) < np.abs(place).max(axis=1)
        best[closer], place[closer] = candidate[closer], found[closer]
    beyond = np.abs(place).max(axis=1)
    far = ~(beyond <= REACH)
    if far.any():
        raise MeshError("skin", [_too_far(points, far, corners[best], place)])
    if np.einsum("ti,ti->", points[triangles[:, 0]], np.cross(*(points[triangles[:, i]] for i in (1, 2)))) < 0.0:
        triangles = triangles[:, ::-1]
    carriers = np.ascontiguousarray(cells[best], dtype=np.int32)
    owners = best[triangles[:, 0]].astype(np.int32)
    return Outside(triangles.astype(np.int32), owners, carriers, trilinear_weights(place))


def divide(
    points: NDArray[np.float64], triangles: NDArray[np.int64], longest: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Halve the edges of a triangle surface until none is longer than ``longest`` [m]; neighbours stay connected."""
    while True:
        pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
        edges, which = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
        long = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1) > longest
        if not long.any():
            return points, triangles
        middle = np.where(long, len(points) + np.cumsum(long) - 1, -1)[which.reshape(-1, 3)]
        points = np.concatenate([points, points[edges[long]].mean(axis=1)])
        count = (middle >= 0).sum(axis=1)
        turn = np.where(
            count == 1, (middle >= 0).argmax(axis=1), np.where(count == 2, (middle < 0).argmax(axis=1) + 1, 0)
        )
        order = (turn[:, None] + np.arange(3)) % 3
        (a, b, c), (ab, bc, ca) = np.take_along_axis(triangles, order, 1).T, np.take_along_axis(middle, order, 1).T
        parts = [triangles[count == 0]]
        for halves, pieces in {
            1: ((a, ab, c), (ab, b, c)),
            2: ((ab, b, bc), (a, ab, bc), (a, bc, c)),
            3: ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)),
        }.items():
            parts += [np.stack(piece, axis=1)[count == halves] for piece in pieces]
        triangles = np.concatenate(parts)


def _too_far(
    points: NDArray[np.float64], far: NDArray[np.bool_], corners: NDArray[np.float64], place: NDArray[np.float64]
) -> str:
    """Say which of the points are ``far`` from the cells (k, 8, 3) that are nearest, by their ``place`` in these."""
    nearest = np.einsum("ka,kai->ki", trilinear_weights(np.clip(place, -1.0, 1.0)), corners)
    away = np.where(far, np.linalg.norm(points - nearest, axis=1), 0.0)
    worst = int(np.argmax(away))
    where = ", ".join(f"{value:.4g}" for value in points[worst])
    edge = np.linalg.norm(corners[worst, 1] - corners[worst, 0])
    share = 0.5 * (REACH - 1.0)
    return (
        f"{far.sum()} of {len(points)} vertices lie far outside of the cells, the farthest {away[worst]:.3g} m, at "
        f"({where}) m; allowed: {share:g} of a cell's edge, which is {edge:.3g} m there; remedy: check scale and place "
        "of the file, or smaller cells"
    )
