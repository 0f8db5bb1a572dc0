# SPDX-License-Identifier: Apache-2.0
"""The kept tangent stiffness, part of the state."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.tangent.springs import Springs


@dataclass(frozen=True, eq=False, kw_only=True)
class Tangent:
    """A kept tangent stiffness; an immutable value.

    Attributes:
        blocks: (k, 3, 3) of pairs of vertices [N/m], positive definite over the free ones.
        motion: (3 b, 3 q) d(vertices of handles with a free axis)/d(rigid rows).
        positions: (n, 3) [m] where it was taken; None for the constant matrix, which does not follow rotations.
        shift: multiple of the constant matrix that was added for definiteness.
        softest: the ratio of a mode's stiffness to its stiffness in this tangent has a least value over all modes; this
            is an upper bound of it. It is 1 if nothing was added and no softer mode was found yet, 0 if it is unknown.
        ends, ways: of the springs between touching parts, as in `Springs`.
        spent: iterations and products since the tangent was evaluated, without the free ones of each solve.
    """

    blocks: NDArray[np.float64]
    motion: NDArray[np.float64]
    positions: NDArray[np.float64] | None = None
    shift: float = 0.0
    ends: NDArray[np.int32] = field(default_factory=lambda: Springs.none().ends)
    ways: NDArray[np.float64] = field(default_factory=lambda: Springs.none().ways)
    spent: int = 0
    softest: float = 0.0
