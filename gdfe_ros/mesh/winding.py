# SPDX-License-Identifier: Apache-2.0
"""Edges of a surface that are open, or whose triangles are wound in opposite directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.edge_ids import number_edges


def edge_counts(triangles: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the edges (e, 2) of triangles (t, 3), how many triangles each has, and by how much directions differ.

    The third array (e,) is the number of triangles that have the edge in ascending order of its vertices, minus the
    number of the other ones.
    """
    ends = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    edges, which = number_edges(np.sort(ends, axis=1))
    balance = np.bincount(which, np.where(ends[:, 0] < ends[:, 1], 1, -1), minlength=len(edges))
    return edges, np.bincount(which, minlength=len(edges)), balance.astype(np.int64)


def open_edges_of(triangles: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the edges (k, 2) that belong to an odd number of triangles."""
    edges, count, _ = edge_counts(triangles)
    return edges[count % 2 == 1]


def disagreeing_edges(triangles: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the edges (k, 2) at which neighbouring triangles are wound in opposite directions."""
    edges, count, balance = edge_counts(triangles)
    return edges[(count % 2 == 0) & (balance != 0)]


def winding_defects(vertices: NDArray[np.float64], triangles: NDArray[np.integer]) -> list[str]:
    """Return a list with the text of a defect if neighbouring triangles disagree about the outside; empty if not."""
    edges = disagreeing_edges(triangles)
    if len(edges) == 0:
        return []
    x, y, z = vertices[edges[0]].mean(axis=0)
    return [
        f"the triangles on both sides of {len(edges)} edges are wound in opposite directions, so that inside and "
        f"outside are not known there, the first at ({x:.4g}, {y:.4g}, {z:.4g}) m; remedy: wind them alike (MeshLab: "
        "Re-Orient all faces coherently, Blender: Recalculate Outside)"
    ]
