# SPDX-License-Identifier: Apache-2.0
"""A binary tree of bounding boxes of triangles, for searches by compiled kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEAF = 4
"""Number of triangles in a leaf."""
_BITS = 20
"""Bits of each coordinate in a Morton code."""


@dataclass(frozen=True, eq=False)
class BoxTree:
    """A complete binary tree of boxes; node i has the children 2 i + 1 and 2 i + 2.

    The triangles are sorted by the Morton codes of their centroids. Leaf k is the last level's k-th node, and has the
    triangles ``LEAF * k`` to ``LEAF * (k + 1) - 1`` of the sorted ones.

    Attributes:
        corners: (t, 3, 3) float64 [m], corners of the sorted triangles.
        normals: (t, 3) float64, unit normals of the sorted triangles; zero for a triangle that is flat.
        order: (t,) int64, the number of each sorted triangle in the given order.
        boxes: (n, 2, 3) float64 [m], lowest and highest corner of each node's box, infinite without triangles.
    """

    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    order: NDArray[np.int64]
    boxes: NDArray[np.float64]

    @classmethod
    def of(cls, vertices: NDArray[np.float64], triangles: NDArray[np.integer], *, flat: float) -> BoxTree:
        """Return the tree of triangles (t, 3) between vertices (n, 3) [m].

        A triangle whose height above its longest edge is at most ``flat`` [m] counts as flat.
        """
        corners = vertices[triangles]
        order = np.argsort(_morton(corners.mean(axis=1)), kind="stable")
        corners = np.ascontiguousarray(corners[order])
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled = np.linalg.norm(across, axis=1)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        solid = doubled > flat * longest
        normals = np.where(solid[:, None], across / np.where(solid, doubled, 1.0)[:, None], 0.0)
        return cls(corners, normals, order, _boxes(corners))


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


def _morton(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the Morton code of each point (n, 3): the bits of its three coordinates in turn."""
    low, span = points.min(axis=0), np.ptp(points, axis=0).max()
    cells = ((points - low) * ((2**_BITS - 1) / span if span > 0.0 else 0.0)).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return code
