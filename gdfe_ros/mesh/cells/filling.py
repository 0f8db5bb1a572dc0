# SPDX-License-Identifier: Apache-2.0
"""Trilinear shape functions of a hexahedron, and the material in cells that are filled only in part.

The material of a cut cell may have any shape. To second order, its stiffness and weight depend only on its volume,
centroid and second moments. A box with the same moments therefore represents the material. The element is this box. The
positions of its corners are interpolated from the cell's corners with trilinear weights (docs/theory/cut_cells.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    dtype=np.float64,
)
"""Reference coordinates (xi, eta, zeta) of the corners in VTK order."""


MODES = np.stack(
    [CORNERS[:, 1] * CORNERS[:, 2], CORNERS[:, 0] * CORNERS[:, 2], CORNERS[:, 0] * CORNERS[:, 1], CORNERS.prod(axis=1)]
)
"""Corner values (4, 8) of the fields eta zeta, xi zeta, xi eta and xi eta zeta: mode i < 3 is constant along axis i."""


NEWTON_STEPS = 25
"""Largest number of Newton steps for a point's reference coordinates; in a parallelepiped the first step is exact."""


LARGEST_COORDINATE = 4.0
"""Largest magnitude of a reference coordinate in Newton's method."""


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

    Newton's method inverts the trilinear map. Magnitudes of coordinates are at most `LARGEST_COORDINATE`. The iteration
    ends for a point when none of its coordinates changes by more than ``within``.
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
        moved = np.clip(last + np.clip(step, -1.0, 1.0), -LARGEST_COORDINATE, LARGEST_COORDINATE)
        reference[sought] = np.where(np.isnan(moved), LARGEST_COORDINATE, moved)
        sought = sought[np.abs(reference[sought] - last).max(axis=1) > within]
        if len(sought) == 0:
            break
    return reference


@dataclass(frozen=True, eq=False)
class Filling:
    """The material in each cell.

    Attributes:
        share: (m,) volume of the material divided by the volume of the cell; it may exceed 1 for a cell that received
            the material of neighbouring slivers.
        centre: (m, 3) centroid of the material in reference coordinates -1 .. 1.
        spread: (m, 3) half edges of the box with the same second moments, in reference coordinates.
    """

    share: NDArray[np.float64]
    centre: NDArray[np.float64]
    spread: NDArray[np.float64]

    @classmethod
    def of_moments(cls, moments: NDArray[np.float64]) -> Filling:
        """Return the filling of cells with the moments (m, 7) that `cube_moments` returns."""
        share = moments[:, 0]
        centre = moments[:, 1:4] / share[:, None]
        variance = moments[:, 4:] / share[:, None] - centre**2
        return cls(share, centre, np.sqrt(3.0 * np.maximum(variance, 0.0)))

    @classmethod
    def whole(cls, count: int) -> Filling:
        """Return the filling of ``count`` uncut cells."""
        return cls(np.ones(count), np.zeros((count, 3)), np.ones((count, 3)))

    @classmethod
    def join(cls, fillings: Sequence[Filling]) -> Filling:
        """Return the concatenation of several fillings."""
        return cls(*(np.concatenate([getattr(each, item.name) for each in fillings]) for item in fields(cls)))

    @cached_property
    def cut(self) -> NDArray[np.intp]:
        """Indices (k,) of the cells that are not entirely filled."""
        return np.flatnonzero((self.share != 1.0) | (self.centre != 0.0).any(axis=1) | (self.spread != 1.0).any(axis=1))

    @cached_property
    def boxes(self) -> NDArray[np.float64]:
        """Trilinear weights (k, 8, 8) in each cut cell: row b has the weights of the cell's corners at box corner b."""
        return trilinear_weights(self.points(CORNERS)[self.cut])

    def points(self, reference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert reference coordinates (p, 3) in a box to reference coordinates (m, p, 3) in the cell of each box."""
        return self.centre[:, None] + self.spread[:, None] * reference

    def of(self, cells: NDArray[np.bool_] | NDArray[np.intp]) -> Filling:
        """Return the filling of the given cells: a mask (m,) or indices."""
        return Filling(*(getattr(self, item.name)[cells] for item in fields(self)))
