# SPDX-License-Identifier: Apache-2.0
"""Volume, centre and second moments of the solid inside a closed surface of triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
