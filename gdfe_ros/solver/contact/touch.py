# SPDX-License-Identifier: Apache-2.0
"""What touches an obstacle, or another part of the body."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Touch:
    """The vertices, or points of a skin, that touch an obstacle, or another part of the body.

    Attributes:
        vertices: (k,) int32; of points of a skin, that which carries most of each.
        places: (k, 3) [m].
        normals: (k, 3) out of the obstacle.
        gaps: (k,) [m] from each vertex to the obstacle: where the mean gap of the faces counts, a vertex that touches
            something round is a little off it.
        presses: (k,) [N] along the normal.
        shears: (k, 3) [N] by friction, on the body.
        slips: (k,) whether a vertex slips, or is free to.
        points: (k,) int32 which of the points of a skin that touch these are, -1 for a vertex; none where nothing
            touches by a skin.
        others: (k,) int32 vertices of the body that these touch most; none where it is an obstacle that they touch.
    """

    vertices: NDArray[np.int32]
    places: NDArray[np.float64]
    normals: NDArray[np.float64]
    gaps: NDArray[np.float64]
    presses: NDArray[np.float64]
    shears: NDArray[np.float64]
    slips: NDArray[np.bool_]
    points: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    others: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))

    @property
    def forces(self) -> NDArray[np.float64]:
        """What the obstacle exerts at each vertex (k, 3) [N]."""
        return self.presses[:, None] * self.normals + self.shears


NOTHING = Touch(
    vertices=np.zeros(0, dtype=np.int32),
    places=np.zeros((0, 3)),
    normals=np.zeros((0, 3)),
    gaps=np.zeros(0),
    presses=np.zeros(0),
    shears=np.zeros((0, 3)),
    slips=np.zeros(0, dtype=np.bool_),
)
"""What touches an obstacle that nothing touches."""
