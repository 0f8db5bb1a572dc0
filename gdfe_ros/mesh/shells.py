# SPDX-License-Identifier: Apache-2.0
"""Closed triangle surfaces of nested shells: inside (by the even-odd rule), volume, centre and second moments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.faces import vertex_pieces

#: Number of pairs of a triangle and a grid column that are tested together.
_CHUNK = 2_000_000


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
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    volumes = np.abs(np.bincount(shell, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6))
    depths = []
    for own, triangle in enumerate(first):
        point = vertices[triangles[triangle, 0]]
        corners = vertices[triangles] - point
        zero = np.zeros(len(corners), dtype=np.int64)
        above = _pierced(corners, zero, zero) & (_heights(corners, zero, zero) > 0)
        around = np.bincount(shell[above], minlength=len(first)) % 2
        around[own] = 0
        depths.append(int(around.sum()))
    return Shells(tuple(depths), tuple(float(volume) for volume in volumes))


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
    toggles = np.zeros((count[0], count[1], count[2] + 1), dtype=np.uint8)
    for x, y, height in _crossings(vertices[triangles], count[:2]):
        layer = np.clip(np.ceil(height), 0, count[2]).astype(np.int64)
        np.add.at(toggles, (x, y, layer), 1)
    return np.cumsum(toggles[:, :, :-1], axis=2, dtype=np.uint8) % 2 == 1


def inside(
    points: NDArray[np.float64], vertices: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return whether each point (k, 3) is inside a closed surface of any orientation, shape (k,), by the even-odd rule.

    A shell winds around a point if its solid angle there is not zero. A point is inside if an odd number of shells wind
    around it.
    """
    shell = shell_numbers(len(vertices), triangles)
    found = np.zeros(len(points), dtype=np.int64)
    for k, point in enumerate(points):
        turns = np.bincount(shell, solid_angles(vertices[triangles] - point)) / (4.0 * np.pi)
        found[k] = (np.abs(turns) > 0.5).sum()
    return found % 2 == 1


def solid_angles(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signed solid angles (t,) at the origin of triangles (t, 3, 3) [m] (van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    ab, bc, ca = (np.einsum("ti,ti->t", *pair) for pair in ((a, b), (b, c), (c, a)))
    return 2.0 * np.arctan2(np.einsum("ti,ti->t", a, np.cross(b, c)), la * lb * lc + ab * lc + bc * la + ca * lb)


def _crossings(
    corners: NDArray[np.float64], count: tuple[int, int]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]]:
    """Yield x, y and height of the crossings of grid columns with triangles (t, 3, 3), in chunks."""
    for which, x, y in _columns(corners, count):
        hit = _pierced(corners[which], x, y)
        yield x[hit], y[hit], _heights(corners[which[hit]], x[hit], y[hit])


def _columns(
    corners: NDArray[np.float64], count: tuple[int, int]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]:
    """Yield pairs of a triangle and a grid column (x, y) in its bounding box, in chunks."""
    low = np.maximum(np.ceil(corners[:, :, :2].min(axis=1)), 0).astype(np.int64)
    high = np.minimum(np.floor(corners[:, :, :2].max(axis=1)), np.array(count) - 1).astype(np.int64)
    width = np.maximum(high - low + 1, 0)
    pairs = width.prod(axis=1)
    chunk = np.cumsum(pairs) // _CHUNK
    for number in range(int(chunk[-1]) + 1):
        members = np.flatnonzero((chunk == number) & (pairs > 0))
        which = np.repeat(members, pairs[members])
        place = np.arange(len(which)) - np.repeat(np.cumsum(pairs[members]) - pairs[members], pairs[members])
        yield which, low[which, 0] + place % width[which, 0], low[which, 1] + place // width[which, 0]


def _pierced(corners: NDArray[np.float64], x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return whether each column at (x, y) pierces its triangle: a ray to +x crosses the projected outline once."""
    hit = np.zeros(len(corners), dtype=bool)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        a, b = corners[:, first, :2], corners[:, second, :2]
        swap = (a[:, 1] > b[:, 1]) | ((a[:, 1] == b[:, 1]) & (a[:, 0] > b[:, 0]))
        a, b = np.where(swap[:, None], b, a), np.where(swap[:, None], a, b)
        rise = b[:, 1] - a[:, 1]
        slope = np.divide(b[:, 0] - a[:, 0], rise, out=np.zeros_like(rise), where=rise > 0)
        hit ^= (a[:, 1] <= y) & (y < b[:, 1]) & (x < a[:, 0] + (y - a[:, 1]) * slope)
    return hit


def _heights(corners: NDArray[np.float64], x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the height z of each triangle at its column (x, y), limited to the heights of its corners."""
    a = corners[:, 0]
    normal = np.cross(corners[:, 1] - a, corners[:, 2] - a)
    fall = (x - a[:, 0]) * normal[:, 0] + (y - a[:, 1]) * normal[:, 1]
    upright = normal[:, 2] == 0.0
    height = a[:, 2] - np.divide(fall, normal[:, 2], out=np.zeros_like(fall), where=~upright)
    return np.clip(height, corners[:, :, 2].min(axis=1), corners[:, :, 2].max(axis=1))


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
    middle = vertices.mean(axis=0)
    corners = vertices[triangles] - middle
    volumes = np.einsum("ti,ti->t", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
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
