# SPDX-License-Identifier: Apache-2.0
"""The points of the surface for self-contact: vertices, and points of skins, which cells carry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.skin import compliances
from gdfe_ros.solver.contact.surface import driven_vertices


@dataclass(frozen=True, eq=False)
class OwnPoints:
    """The n vertices of a body, and the p contact points of its skins after them.

    Attributes:
        count: number n of vertices.
        corners: (p, 8) int32 vertices that carry each contact point.
        weights: (p, 8) weights of these vertices.
        main: (n + p,) int32 for each point, the vertex with the largest weight.
        numbers: (n + p,) int32 number of each contact point; -1 for a vertex.
        carriers, shares: (n + p, c) int32 vertices that carry each point, and their weights. With skins c is 8, and a
            vertex carries itself; without, c is 1.
    """

    count: int
    corners: NDArray[np.int32]
    weights: NDArray[np.float64]
    main: NDArray[np.int32]
    numbers: NDArray[np.int32]
    carriers: NDArray[np.int32]
    shares: NDArray[np.float64]

    @classmethod
    def of(cls, body: Body) -> OwnPoints:
        """Return the points of a body."""
        count, skin = len(body.rest), body.skin
        corners = np.zeros((0, 8), np.int32) if skin is None else skin.corners
        weights = np.zeros((0, 8)) if skin is None else skin.weights
        main = np.take_along_axis(corners, np.abs(weights).argmax(axis=1)[:, None], axis=1)[:, 0]
        numbers = np.concatenate([np.full(count, -1), np.arange(len(corners))]).astype(np.int32)
        own, width = np.arange(count, dtype=np.int32), 8 if len(corners) else 1
        carriers, shares = np.repeat(own[:, None], width, axis=1), np.tile(np.eye(1, width), (count, 1))
        if len(corners):
            carriers, shares = np.concatenate([carriers, corners]), np.concatenate([shares, weights])
        return cls(count, corners, weights, np.concatenate([own, main]), numbers, carriers, shares)

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all points (n + p, 3) [m] for vertices at ``positions`` (n, 3) [m]."""
        if not len(self.corners):
            return positions
        return np.concatenate([positions, np.einsum("pa,pai->pi", self.weights, positions[self.corners])])

    def yielding(self, body: Body, diagonal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the compliance (n + p,) [m/N] of each point, from the constant matrix' diagonal (n,) [N/m].

        Vertices that handles drive have no compliance.
        """
        driven = driven_vertices(body)
        own = np.where(driven, 0.0, 1.0 / diagonal)
        return np.concatenate([own, compliances(self.corners, self.weights, driven, diagonal)])

    def about(self, cells: NDArray[np.int32], chosen: NDArray[np.int32]) -> sparse.csr_matrix:
        """Return the points (k, n + p) of all cells that share a vertex with each of the ``chosen`` cells (k, c).

        ``cells`` (m, c) are all cells, each with its vertices.
        """
        own, every = incidence(chosen, self.count), incidence(cells, self.count)
        near = sparse.hstack([own @ every.T @ every, own @ incidence(self.corners, self.count).T]).tocsr()
        near.sort_indices()
        return near


def incidence(cells: NDArray[np.int32], count: int) -> sparse.csr_matrix:
    """Return a sparse matrix (m, n) with ones for the vertices of each cell (m, c)."""
    rows = np.repeat(np.arange(len(cells)), cells.shape[1])
    return sparse.csr_matrix((np.ones(cells.size, np.int32), (rows, cells.ravel())), shape=(len(cells), count))
