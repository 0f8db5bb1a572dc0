# SPDX-License-Identifier: Apache-2.0
"""Where a frame is in another."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a frame is in another: origin (3,) [m] and the turn of its axes."""

    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    turn: Rotation = field(default_factory=Rotation.identity)

    @classmethod
    def of(cls, translation: Any, rotation: Any) -> Placement:
        """Read it from a message: x, y, z [m] and a quaternion."""
        turn = Rotation.from_quat([rotation.x, rotation.y, rotation.z, rotation.w])
        return cls(np.array([translation.x, translation.y, translation.z]), turn)

    def __matmul__(self, inner: Placement) -> Placement:
        """Give where ``inner``, which is given in this frame, is in the frame that this one is given in."""
        return Placement(self.origin + self.turn.apply(inner.origin), self.turn * inner.turn)

    def inverse(self) -> Placement:
        """Give where the other frame is in this one."""
        back = self.turn.inv()
        return Placement(-back.apply(self.origin), back)
