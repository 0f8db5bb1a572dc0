# SPDX-License-Identifier: Apache-2.0
"""Rigid plates that close a surface whose open edges lie on rigid sets of vertices.

The edges of a membrane that is clamped in a rim lie on a handle. Whichever surface closes them, as long as it moves
with the handle, the enclosed volume changes by the same amount, and the pressure on it has the same resultant.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.cavities import corners_of


def close_on(faces: NDArray[np.int32], holder: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the plates (k, c) that close a surface, as faces with repeated nodes, and the edges (l, 2) that leak.

    All open edges on one holder are joined to one of their vertices. A side of a six-node plate between two vertices
    without a common edge has one of these vertices as its middle node: it runs along the same straight line.

    Args:
        faces: vertex ids (q, 4) or (q, 6), oriented.
        holder: (n,) number of the rigid set of each vertex, -1 for vertices of none.
    """
    edges = _open_half_edges(faces)
    ends = holder[edges]
    leaks = (ends != ends[:, :1]).any(axis=1) | (ends[:, 0] < 0)
    plates = [np.zeros((0, faces.shape[1]), np.int32)]
    for number in np.unique(ends[:, 0]) if not leaks.any() else ():
        own = ends[:, 0] == number
        out, into = (np.bincount(edges[own, side], minlength=len(holder)) for side in (0, 1))
        if (out != into).any():
            leaks |= own
        else:
            plates.append(_fan(edges[own], faces.shape[1]))
    return np.concatenate(plates), edges[leaks, :2]


def _open_half_edges(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return begin, end and, of six-node faces, middle node (k, 2 or 3) of each half edge without a counterpart."""
    corners = corners_of(faces)
    edges = [corners.ravel(), np.roll(corners, -1, axis=1).ravel()]
    if faces.shape[1] == 6:
        edges.append(faces[:, 3:].ravel())
    half = np.stack(edges, axis=1)
    _, which = np.unique(np.sort(half[:, :2], axis=1), axis=0, return_inverse=True)
    sign = np.where(half[:, 0] < half[:, 1], 1, -1) * (half[:, 0] != half[:, 1])
    balance = np.bincount(which.ravel(), sign)[which.ravel()]
    found = half[sign * balance > 0]
    first = np.unique(found[:, :2], axis=0, return_index=True)[1]
    return np.ascontiguousarray(found[np.sort(first)], dtype=np.int32)


def _fan(edges: NDArray[np.int32], size: int) -> NDArray[np.int32]:
    """Return triangles that join half edges (k, 2 or 3) to the first vertex, as faces with ``size`` nodes."""
    origin = edges[0, 0]
    apart = edges[(edges[:, :2] != origin).all(axis=1)]
    start, end = apart[:, 0], apart[:, 1]
    first = np.full(len(apart), origin, dtype=np.int32)
    if size == 4:
        return np.stack([first, end, start, start], axis=1)
    beside = {int(a if b == origin else b): int(m) for a, b, m in edges if origin in (a, b)}
    sides = [[beside.get(int(vertex), int(origin)) for vertex in vertices] for vertices in (end, start)]
    return np.stack([first, end, start, sides[0], apart[:, 2], sides[1]], axis=1).astype(np.int32)
