# SPDX-License-Identifier: Apache-2.0
"""The kept tangent stiffness, part of the state, and its springs, which couple vertices that no element couples.

A commanded cable length and a commanded chamber volume act like springs. The length of a spring is linear in small
displacements: d = a . x. A spring of stiffness k adds k a a^T to the tangent. These entries may couple any vertices,
and would fill the factor. The rows sqrt(k) a of all springs therefore form a separate matrix G, with
which `substitution` corrects the solutions of the factor without springs.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Tangent:
    """A kept tangent stiffness; an immutable value.

    Attributes:
        blocks: (k, 3, 3) [N/m] blocks of coupled pairs of vertices; the part of the free vertices is positive definite.
        motion: (3 b, 3 q) d(vertices of handles with a free axis)/d(rigid rows).
        positions: (n, 3) [m] at which the tangent was taken; None for the constant matrix, which does not follow
            rotations.
        shift: multiple of the constant matrix that was added for definiteness.
        springs: (m, 3 r) [(N/m)^(1/2)] rows G of the springs, in the unknowns.
        owners: (m,) int32 term of each spring.
        stages: (t,) int32 stages of the terms (`Term.stage`); empty if all are 0.
        spent: number of iterations since the tangent was evaluated.
        solves: number of solves with the tangent.
        latest: the part of ``spent`` in the last of these solves.
    """

    blocks: NDArray[np.float64]
    motion: NDArray[np.float64]
    positions: NDArray[np.float64] | None = None
    shift: float = 0.0
    springs: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    owners: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    stages: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    spent: int = 0
    solves: int = 0
    latest: int = 0

    def overdue(self, cost: float) -> bool:
        """Return whether a new tangent that costs as much as ``cost`` iterations lowers the mean cost of a solve."""
        return self.latest * self.solves > cost + self.spent
