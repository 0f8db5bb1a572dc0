# SPDX-License-Identifier: Apache-2.0
"""Filled fraction of cells: a box in each cell with the moments of its material.

The material of a cut cell may have any shape. To second order, its stiffness and weight depend only on its volume,
centroid and second moments. A box with the same moments therefore represents the cell. The element on this box has
corners that the cell's corners carry with trilinear weights (docs/theory/cut_cells.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.trilinear import CORNERS, trilinear_weights


@dataclass(frozen=True, eq=False)
class Filling:
    """The material in each cell.

    Attributes:
        share: (m,) volume of the material over that of the cell; above 1 for a cell that includes neighbouring slivers.
        centre: (m, 3) centroid of the material in reference coordinates -1 .. 1.
        spread: (m, 3) half edges of the box with the same second moments, in reference coordinates.
    """

    share: NDArray[np.float64]
    centre: NDArray[np.float64]
    spread: NDArray[np.float64]

    @classmethod
    def of_moments(cls, moments: NDArray[np.float64]) -> Filling:
        """Return the filling from means over cells (m, 7): 1, xi, eta, zeta and their squares in the material."""
        share = moments[:, 0]
        centre = moments[:, 1:4] / share[:, None]
        variance = moments[:, 4:] / share[:, None] - centre**2
        return cls(share, centre, np.sqrt(3.0 * np.maximum(variance, 0.0)))

    @classmethod
    def whole(cls, count: int) -> Filling:
        """Return the filling of ``count`` uncut cells."""
        return cls(np.ones(count), np.zeros((count, 3)), np.ones((count, 3)))

    @classmethod
    def joined(cls, fillings: Sequence[Filling]) -> Filling:
        """Return the concatenation of several fillings."""
        return cls(*(np.concatenate([getattr(each, item.name) for each in fillings]) for item in fields(cls)))

    @cached_property
    def cut(self) -> NDArray[np.intp]:
        """The cells (k,) that are not entirely filled."""
        return np.flatnonzero((self.share != 1.0) | (self.centre != 0.0).any(axis=1) | (self.spread != 1.0).any(axis=1))

    @cached_property
    def boxes(self) -> NDArray[np.float64]:
        """Trilinear weights (k, 8, 8) of a cut cell's corners at the corners of its box."""
        return trilinear_weights(self.points(CORNERS)[self.cut])

    def points(self, reference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the reference coordinates (m, p, 3) in the cells of points (p, 3) of their boxes."""
        return self.centre[:, None] + self.spread[:, None] * reference

    def of(self, cells: NDArray[np.bool_] | NDArray[np.intp]) -> Filling:
        """Return the filling of some of the cells."""
        return Filling(*(getattr(self, item.name)[cells] for item in fields(self)))
