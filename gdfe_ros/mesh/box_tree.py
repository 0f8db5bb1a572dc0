# SPDX-License-Identifier: Apache-2.0
"""A binary tree of bounding boxes of triangles, for searches by compiled kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

LEAF = 4
"""Number of triangles in a leaf."""
FLAT = 1e-12
"""Height of a flat triangle, divided by the diagonal of the surface."""


@dataclass(frozen=True, eq=False)
class BoxTree:
    """A complete binary tree of boxes of triangles that are not flat; node i has the children 2 i + 1 and 2 i + 2.

    The triangles are sorted as the leaves of scipy's tree of their centroids. Leaf k is the last level's k-th node, and
    has the triangles ``LEAF * k`` to ``LEAF * (k + 1) - 1`` of the sorted ones.

    Attributes:
        corners: (t, 3, 3) float64 [m], corners of the sorted triangles.
        normals: (t, 3) float64, unit normals of the sorted triangles.
        order: (t,) int64, the number of each sorted triangle in the given order.
        boxes: (n, 2, 3) float64 [m], lowest and highest corner of each node's box, infinite without triangles.
    """

    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    order: NDArray[np.int64]
    boxes: NDArray[np.float64]

    @classmethod
    def of(cls, vertices: NDArray[np.float64], triangles: NDArray[np.integer], *, flat: float = FLAT) -> BoxTree:
        """Return the tree of triangles (t, 3) between vertices (n, 3) [m].

        A triangle is flat if its height above its longest edge, divided by the surface's diagonal, is at most ``flat``.
        """
        corners = vertices[triangles]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled = np.linalg.norm(across, axis=1)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        order = np.flatnonzero(doubled > flat * float(np.linalg.norm(np.ptp(vertices, axis=0))) * longest)
        order = order[cKDTree(corners[order].mean(axis=1), leafsize=LEAF).indices]
        corners = np.ascontiguousarray(corners[order])
        return cls(corners, across[order] / doubled[order, None], order, _boxes(corners))


def _boxes(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    leaves = 1
    while LEAF * leaves < len(corners):
        leaves *= 2
    padded = np.tile(np.array([np.inf, -np.inf])[:, None], (LEAF * leaves, 1, 3))
    padded[: len(corners), 0], padded[: len(corners), 1] = corners.min(axis=1), corners.max(axis=1)
    levels = [_united(padded, LEAF)]
    while len(levels[-1]) > 1:
        levels.append(_united(levels[-1], 2))
    boxes = np.concatenate(levels[::-1])
    boxes[boxes[:, 1, 0] < boxes[:, 0, 0]] = np.inf
    return np.ascontiguousarray(boxes)


def _united(boxes: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the boxes around each ``count`` consecutive boxes."""
    groups = boxes.reshape(-1, count, 2, 3)
    return np.stack([groups[:, :, 0].min(axis=1), groups[:, :, 1].max(axis=1)], axis=1)
