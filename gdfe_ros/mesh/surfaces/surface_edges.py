# SPDX-License-Identifier: Apache-2.0
"""Edges of triangle surfaces: unique edges, open edges, inconsistent winding, and division of long edges."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import show_point


def number_edges(ends: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the distinct rows (e, 2) of ``ends`` (k, 2), in ascending order, and the index (k,) of each row in them.

    ``ends`` are vertex ids >= 0. The result is that of ``np.unique(ends, axis=0, return_inverse=True)``, but it is
    several times faster, because each row is sorted as one number.
    """
    if not len(ends):
        return np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
    count = int(ends.max()) + 1
    found, which = np.unique(ends[:, 0].astype(np.int64) * count + ends[:, 1], return_inverse=True)
    return np.stack([found // count, found % count], axis=1), which.reshape(-1)


def edge_counts(faces: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the edges (e, 2) of faces (q, 3 or 4), the number of faces at each edge, and the balance of directions.

    The balance (e,) is the number of faces that run through the edge from its lower to its higher vertex id, minus the
    number of faces that run in the opposite direction.
    """
    ends = np.stack([faces.ravel(), np.roll(faces, -1, axis=1).ravel()], axis=1)
    edges, which = number_edges(np.sort(ends, axis=1))
    balance = np.bincount(which, np.where(ends[:, 0] < ends[:, 1], 1, -1), minlength=len(edges))
    return edges, np.bincount(which, minlength=len(edges)), balance.astype(np.int64)


def open_edges(faces: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the edges (k, 2) at which a surface of oriented faces (q, 3 or 4) is not closed.

    In a closed surface with consistent normals each edge occurs equally often in both directions, and the result is
    empty.
    """
    edges, _, balance = edge_counts(faces)
    return edges[balance != 0]


def is_closed(faces: NDArray[np.integer]) -> bool:
    """Return whether a surface is closed: each edge occurs equally often in both directions."""
    return len(open_edges(faces)) == 0


def odd_edges(triangles: NDArray[np.integer]) -> NDArray[np.int64]:
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
    place = show_point(vertices[edges[0]].mean(axis=0))
    return [
        f"the triangles on both sides of {len(edges)} edges are wound in opposite directions, so that inside and "
        f"outside are not known there, the first at {place} m; remedy: wind them alike (MeshLab: "
        "Re-Orient all faces coherently, Blender: Recalculate Outside)"
    ]


Levels = tuple[int, int, int]
"""Number of halvings of each edge of a triangle; edge j is opposite to corner j."""


def refine(
    points: NDArray[np.float64], triangles: NDArray[np.int64], longest: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Divide triangles so that no part of an original edge is longer than ``longest``.

    Each edge is divided into equal parts, whose number is a power of two. A triangle whose edges are all too long is
    divided into four similar triangles, repeatedly. A long thin triangle with one edge that is short enough is divided
    into a strip of triangles between its two other edges. Lines inside a strip are longer than ``longest`` by at most
    the length of the short edge.

    Args:
        points: (k, 3) [m].
        triangles: (t, 3) ids of points.
        longest: largest length of a part of an edge [m].

    Returns:
        Points [m], the given points first, and ids of the points of each new triangle, with the same orientation.
    """
    ends = np.sort(np.stack([triangles[:, [1, 2, 0]], triangles[:, [2, 0, 1]]], axis=2), axis=2)
    edges, which = number_edges(ends.reshape(-1, 2))
    which = which.reshape(-1, 3)
    lengths = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    levels = np.ceil(np.log2(np.maximum(lengths / longest, 1.0))).astype(np.int64)
    inner = 2**levels - 1
    first = len(points) + np.cumsum(inner) - inner
    owner = np.repeat(np.arange(len(edges)), inner)
    share = (np.arange(len(owner)) - (first - len(points))[owner] + 1) / 2.0 ** levels[owner]
    start, end = points[edges[owner, 0]], points[edges[owner, 1]]
    found = [points, start + share[:, None] * (end - start)]
    count, pieces = len(points) + len(owner), []
    kinds, kind = np.unique(levels[which], axis=0, return_inverse=True)
    for number, cut in enumerate(kinds):
        rows = np.flatnonzero(kind.reshape(-1) == number)
        places, parts = _template(tuple(map(int, cut)))
        ids = np.empty((len(rows), len(places)), dtype=np.int64)
        inside = (places > 0.0).all(axis=1)
        for j in range(3):
            a, b = triangles[rows, (j + 1) % 3], triangles[rows, (j + 2) % 3]
            ids[:, places[:, j] == 1.0] = triangles[rows, j, None]
            on = (places[:, j] == 0.0) & (places.max(axis=1) < 1.0)
            share = np.where((a < b)[:, None], places[on, (j + 2) % 3], places[on, (j + 1) % 3])
            ids[:, on] = first[which[rows, j], None] + np.rint(share * 2.0 ** cut[j]).astype(np.int64) - 1
        ids[:, inside] = count + np.arange(len(rows) * inside.sum()).reshape(len(rows), -1)
        count += len(rows) * int(inside.sum())
        found.append(np.einsum("pj,tji->tpi", places[inside], points[triangles[rows]]).reshape(-1, 3))
        pieces.append(ids[:, parts].reshape(-1, 3))
    return np.concatenate(found), np.concatenate(pieces)


@lru_cache(maxsize=256)
def _template(cut: Levels) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the division of a triangle whose edges have the levels ``cut``.

    It consists of points (p, 3) in exact barycentric coordinates, and of triangles (t, 3) between these points.
    """
    count = 2 ** min(cut)
    small = _similar_triangles(count)
    strip = _strip(tuple(level - min(cut) for level in cut))
    corners = np.einsum("qaj,tji->qtai", strip, small).reshape(-1, 3)
    places, ids = np.unique(corners, axis=0, return_inverse=True)
    return places, ids.reshape(-1, 3)


def _similar_triangles(count: int) -> NDArray[np.float64]:
    """Divide a triangle into ``count``^2 similar triangles; return their barycentric corners (t, 3, 3)."""
    found = []
    for i in range(count):
        for j in range(count - i):
            found.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j + 1 < count:
                found.append([(i + 1, j + 1), (i, j + 1), (i + 1, j)])
    second, third = np.moveaxis(np.array(found, dtype=float) / count, 2, 0)
    return np.stack([1.0 - second - third, second, third], axis=2)


def _strip(cut: Levels) -> NDArray[np.float64]:
    """Divide a triangle with one undivided edge into a strip of triangles; return their barycentric corners (t, 3, 3).

    The first triangle of the strip is at the corner opposite to the undivided edge.
    """
    turn = cut.index(0)
    ends = 2 ** cut[(turn + 2) % 3], 2 ** cut[(turn + 1) % 3]
    at, found = [1, 1], [((0, 0.0), (0, 1.0 / ends[0]), (1, 1.0 / ends[1]))]
    while at[0] < ends[0] or at[1] < ends[1]:
        side = 0 if (at[0] + 1) * ends[1] <= (at[1] + 1) * ends[0] else 1
        here = [(k, at[k] / ends[k]) for k in (0, 1)]
        at[side] += 1
        on = (side, at[side] / ends[side])
        found.append((here[0], on, here[1]))
    corners = np.zeros((len(found), 3, 3))
    for t, corner in enumerate(found):
        for a, (side, share) in enumerate(corner):
            corners[t, a, turn], corners[t, a, (turn + 1 + side) % 3] = 1.0 - share, share
    return corners
