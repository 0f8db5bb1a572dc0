# SPDX-License-Identifier: Apache-2.0
"""Trilinear shape functions of a hexahedron: corners, hourglass modes, weights, reference coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    dtype=np.float64,
)
"""Reference coordinates (xi, eta, zeta) of the corners in VTK order."""


MODES = np.stack(
    [
        CORNERS[:, 1] * CORNERS[:, 2],
        CORNERS[:, 0] * CORNERS[:, 2],
        CORNERS[:, 0] * CORNERS[:, 1],
        CORNERS.prod(axis=1),
    ]
)
"""Corner values (4, 8) of the fields eta zeta, xi zeta, xi eta and xi eta zeta: mode i < 3 is constant along axis i."""


NEWTON_STEPS = 25
"""Limit of Newton steps for a point's reference coordinates; on a parallelepiped the first step is exact."""


FARTHEST = 4.0
"""Limit of the magnitude of reference coordinates in Newton's method."""


SETTLED = 1e-8
"""Newton's method ends when a point's reference coordinates change by less than this. The remaining error is about the
square of this value, below double precision.
"""


def trilinear_weights(reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights (..., 8) of a cell's corners at reference coordinates (..., 3)."""
    return 0.125 * np.prod(1.0 + reference[..., None, :] * CORNERS, axis=-1)


def trilinear_slopes(reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return dN_a/dxi_j (..., 8, 3) of the corners' weights at reference coordinates (..., 3)."""
    factors = 1.0 + reference[..., None, :] * CORNERS
    return 0.125 * CORNERS * factors[..., [1, 0, 0]] * factors[..., [2, 2, 1]]


def reference_coordinates(
    points: NDArray[np.float64], corners: NDArray[np.float64], *, within: float = SETTLED
) -> NDArray[np.float64]:
    """Return the reference coordinates (k, 3) of points (k, 3), or of one point (3,), in cells with corners (k, 8, 3).

    They invert the trilinear map by Newton's method and are limited to -`FARTHEST` .. `FARTHEST`. The iteration ends
    for a point when none of its coordinates changes by more than ``within``.
    """
    reference, sought = np.zeros((len(corners), 3)), np.arange(len(corners))
    points = np.broadcast_to(points, reference.shape)
    for _ in range(NEWTON_STEPS):
        last, nodes = reference[sought], corners[sought]
        gap = points[sought] - np.einsum("ka,kai->ki", trilinear_weights(last), nodes)
        a, b, c = np.moveaxis(nodes.transpose(0, 2, 1) @ trilinear_slopes(last), 2, 0)
        adjugate = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):  # the map may be singular far outside of a tapered cell
            step = np.einsum("kij,kj->ki", adjugate, gap) / np.einsum("ki,ki->k", a, adjugate[:, 0])[:, None]
        moved = np.clip(last + np.clip(step, -1.0, 1.0), -FARTHEST, FARTHEST)
        reference[sought] = np.where(np.isnan(moved), FARTHEST, moved)
        sought = sought[np.abs(reference[sought] - last).max(axis=1) > within]
        if len(sought) == 0:
            break
    return reference
