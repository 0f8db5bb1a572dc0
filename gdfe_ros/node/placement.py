# SPDX-License-Identifier: Apache-2.0
"""Place of one frame in another."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class Placement:
    """Place of one frame in another: origin (3,) [m] and rotation of its axes."""

    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    turn: Rotation = field(default_factory=Rotation.identity)

    @classmethod
    def of(cls, translation: Any, rotation: Any) -> Placement:
        """Return the placement of a message: x, y, z [m] and a quaternion."""
        turn = Rotation.from_quat([rotation.x, rotation.y, rotation.z, rotation.w])
        return cls(np.array([translation.x, translation.y, translation.z]), turn)

    def __matmul__(self, inner: Placement) -> Placement:
        """Return ``inner``, which is given in this frame, in the parent of this frame."""
        return Placement(self.origin + self.turn.apply(inner.origin), self.turn * inner.turn)

    def inverse(self) -> Placement:
        """Return the parent frame in this one."""
        back = self.turn.inv()
        return Placement(-back.apply(self.origin), back)
