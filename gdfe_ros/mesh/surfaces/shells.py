# SPDX-License-Identifier: Apache-2.0
"""Closed triangle surfaces of nested shells: inside (by the even-odd rule), volume, centre and second moments.

`BoxTree`, a tree of bounding boxes of triangles, serves the searches in `triangle_kernels`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.mesh.cells.faces import vertex_pieces


@dataclass(frozen=True)
class Shells:
    """Nesting and volumes of the shells (connected pieces) of a closed surface.

    Attributes:
        depths: number of other shells around each shell; odd for a cavity.
        volumes: volume inside each shell [m^3], positive for either orientation of its triangles.
    """

    depths: tuple[int, ...]
    volumes: tuple[float, ...]

    @property
    def n_cavities(self) -> int:
        """Number of shells that bound a cavity."""
        return sum(depth % 2 for depth in self.depths)

    @property
    def volume(self) -> float:
        """Volume of the material [m^3]."""
        return sum(v * (-1) ** d for v, d in zip(self.volumes, self.depths, strict=True))


def shells(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> Shells:
    """Return the nesting and the volumes of the shells of a closed surface.

    Args:
        vertices: positions [m], shape (n, 3).
        triangles: vertex ids, shape (t, 3); the shells must not intersect each other.
    """
    shell = shell_numbers(len(vertices), triangles)
    _, first = np.unique(shell, return_index=True)
    around = _shells_around(vertices[triangles[first, 0]], vertices, triangles)
    np.fill_diagonal(around, False)
    volumes = np.abs(np.bincount(shell, cone_volumes(vertices, triangles)))
    return Shells(tuple(around.sum(axis=1).tolist()), tuple(volumes.tolist()))


def cone_volumes(vertices: NDArray[np.float64], triangles: NDArray[np.integer]) -> NDArray[np.float64]:
    """Return the volumes (t,) [m^3] of the tetrahedra between the mean of the vertices and triangles (t, 3).

    The sum over a closed surface is the volume inside, positive for outward normals.
    """
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    return np.einsum("ti,ti->t", a, np.cross(b, c)) / 6.0


def doubled_areas(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return twice the area vectors (t, 3) [m^2] of triangles with ``corners`` (t, 3, 3) [m], and their lengths."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return across, np.linalg.norm(across, axis=1)


def shell_numbers(n: int, triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number (t,) of the shell to which each triangle belongs, in the order of `Shells`.

    ``triangles`` (t, 3) are ids of ``n`` vertices.
    """
    return np.unique(vertex_pieces(triangles, n)[triangles[:, 0]], return_inverse=True)[1]


def points_inside(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], count: tuple[int, int, int]
) -> NDArray[np.bool_]:
    """Return whether each point (i, j, k) of a grid is inside a closed surface.

    If a column along z pierces a triangle, the points of the column above the triangle change between inside and
    outside. An edge belongs to only one of its two triangles. A column through an edge or a corner thus crosses the
    surface once.

    Args:
        vertices: positions in units of the point spacing, shape (n, 3).
        triangles: vertex ids of a closed surface, shape (t, 3).
        count: number of points along each axis.

    Returns:
        Array of bool, shape ``count``.
    """
    from gdfe_ros.mesh.surfaces.cell_kernels import crossings  # scenes without surfaces load without numba

    toggles = np.zeros((count[1] * count[0], count[2] + 1), dtype=np.uint8)
    column, height = crossings(np.asarray(vertices[triangles], dtype=np.float64), tuple(map(int, count)))
    np.add.at(toggles, (column, np.ceil(height).astype(np.int64)), 1)
    inner = np.cumsum(toggles[:, :-1], axis=1, dtype=np.uint8) % 2 == 1
    return inner.reshape(count[1], count[0], count[2]).transpose(1, 0, 2)


def inside(
    points: NDArray[np.float64], vertices: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return whether each point (k, 3) is inside a closed surface of any orientation, shape (k,), by the even-odd rule.

    A point is inside if an odd number of shells wind around it.
    """
    return _shells_around(points, vertices, triangles).sum(axis=1) % 2 == 1


def _shells_around(
    points: NDArray[np.float64], vertices: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return whether each of the s shells winds around each point (k, 3), shape (k, s), from its solid angle."""
    shell = shell_numbers(len(vertices), triangles)
    angles = [np.bincount(shell, solid_angles(vertices[triangles] - point)) for point in points]
    return np.abs(angles).reshape(len(points), int(shell.max(initial=-1)) + 1) > 2.0 * np.pi


def solid_angles(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signed solid angles (t,) at the origin of triangles (t, 3, 3) [m] (van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    ab, bc, ca = (np.einsum("ti,ti->t", *pair) for pair in ((a, b), (b, c), (c, a)))
    return 2.0 * np.arctan2(np.einsum("ti,ti->t", a, np.cross(b, c)), la * lb * lc + ab * lc + bc * la + ca * lb)


ALIKE = 1e-6
"""The axes x, y, z count as principal axes if the off-diagonal second moments divided by the trace are at most this."""


@dataclass(frozen=True, eq=False)
class SolidIntegrals:
    """Integrals over a solid of uniform density.

    Attributes:
        volume: volume of the solid [m^3].
        centre: (3,) centre of mass [m].
        axes: (3, 3) rotation matrix whose columns are the principal axes, ordered to be close to x, y and z.
        moments: (3,) means of x^2, y^2, z^2 over the volume [m^2]; the coordinates are along the principal axes, from
            the centre of mass.
    """

    volume: float
    centre: NDArray[np.float64]
    axes: NDArray[np.float64]
    moments: NDArray[np.float64]


def inertia_of(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> SolidIntegrals:
    """Return the volume, the centre of mass and the principal second moments of a solid.

    The solid is a sum of signed tetrahedra between a point o and each triangle (a, b, c). Positions are relative to o.
    With V = det(a, b, c) / 6 and s = a + b + c, the integral of x x^T over one tetrahedron is
    V / 20 (a a^T + b b^T + c c^T + s s^T).

    Args:
        vertices: (n, 3) [m].
        triangles: (t, 3) ids of a closed surface with outward orientation.
    """
    middle, volumes = vertices.mean(axis=0), cone_volumes(vertices, triangles)
    corners = vertices[triangles] - middle
    sums, volume = corners.sum(axis=1), float(volumes.sum())
    centre = volumes @ sums / (4.0 * volume)
    squares = np.einsum("t,tai,taj->ij", volumes, corners, corners) + np.einsum("t,ti,tj->ij", volumes, sums, sums)
    spread = squares / (20.0 * volume) - np.outer(centre, centre)
    axes = _principal_axes(spread)
    return SolidIntegrals(volume, middle + centre, axes, np.einsum("ia,ij,ja->a", axes, spread, axes))


def _principal_axes(spread: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the principal axes of a symmetric matrix as columns; the unit matrix if it is diagonal within `ALIKE`."""
    beside = np.abs(spread - np.diag(np.diag(spread))).max()
    if beside <= ALIKE * np.trace(spread):
        return np.eye(3)
    _, axes = np.linalg.eigh(spread)
    order, left = [], [0, 1, 2]
    for row in np.argsort(-np.abs(axes).max(axis=1)):
        best = max(left, key=lambda column: abs(axes[row, column]))
        left.remove(best)
        order.append((int(row), best))
    axes = axes[:, [column for _, column in sorted(order)]]
    axes = axes * np.where(np.diag(axes) < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, np.argmin(np.abs(np.diag(axes)))] *= -1.0
    return axes


LEAF = 4
"""Number of triangles in a leaf of a `BoxTree`."""
FLAT = 1e-12
"""A triangle is flat if its height above its longest edge, divided by the surface's diagonal, is at most this."""


@dataclass(frozen=True, eq=False)
class BoxTree:
    """A complete binary tree of boxes of triangles that are not flat; node i has the children 2 i + 1 and 2 i + 2.

    The triangles are sorted in the order of the leaves of scipy's tree of their centroids. Leaf k is the k-th node of
    the last level, and holds the sorted triangles ``LEAF * k`` to ``LEAF * (k + 1) - 1``.

    Attributes:
        corners: (t, 3, 3) float64 [m], corners of the sorted triangles.
        normals: (t, 3) float64, unit normals of the sorted triangles.
        order: (t,) int64, index of each sorted triangle in the given surface.
        boxes: (n, 2, 3) float64 [m], lowest and highest corner of each node's box; infinite for a node without
            triangles.
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
        across, doubled = doubled_areas(corners)
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
    levels = [_unite(padded, LEAF)]
    while len(levels[-1]) > 1:
        levels.append(_unite(levels[-1], 2))
    boxes = np.concatenate(levels[::-1])
    boxes[boxes[:, 1, 0] < boxes[:, 0, 0]] = np.inf
    return np.ascontiguousarray(boxes)


def _unite(boxes: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the bounding box of each group of ``count`` consecutive boxes."""
    groups = boxes.reshape(-1, count, 2, 3)
    return np.stack([groups[:, :, 0].min(axis=1), groups[:, :, 1].max(axis=1)], axis=1)
