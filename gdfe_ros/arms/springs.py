# SPDX-License-Identifier: Apache-2.0
"""Springs between the motors and the links of an arm: joints that yield under load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class JointSprings:
    """Springs and dampers of the yielding joints of an arm.

    The torque of a motor at position theta on a link at position q is

        tau = k (theta - q) + d (theta' - q').

    Attributes:
        yielding: indices of the yielding joints (y,) among the commanded joints.
        stiffness: k (y,) [N m/rad] or [N/m].
        damping: d (y,) [N m s/rad] or [N s/m].
    """

    yielding: NDArray[np.int64]
    stiffness: Vector
    damping: Vector

    def torques(self, stretch: Vector, rate: Vector) -> Vector:
        """Return tau (y,) of springs with ``stretch`` theta - q (y,) that changes at the ``rate`` (y,)."""
        return self.stiffness * stretch + self.damping * rate
