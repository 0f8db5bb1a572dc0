# SPDX-License-Identifier: Apache-2.0
"""Filled fraction of cells, and the box that represents the material of a cut cell.

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

from gdfe_ros.mesh.trilinear import CORNERS, trilinear_weights


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
    def joined(cls, fillings: Sequence[Filling]) -> Filling:
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
