# SPDX-License-Identifier: Apache-2.0
"""Placement of one frame in another."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class Placement:
    """Placement of one frame in another: origin (3,) [m] and rotation of its axes."""

    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    turn: Rotation = field(default_factory=Rotation.identity)

    @classmethod
    def of(cls, translation: Any, rotation: Any) -> Placement:
        """Return the placement with the translation x, y, z [m] and the rotation, a quaternion, of a message."""
        turn = Rotation.from_quat([rotation.x, rotation.y, rotation.z, rotation.w])
        return cls(np.array([translation.x, translation.y, translation.z]), turn)

    def __matmul__(self, inner: Placement) -> Placement:
        """Return the placement in this frame's parent of a frame whose placement in this frame is ``inner``."""
        return Placement(self.origin + self.turn.apply(inner.origin), self.turn * inner.turn)

    def inverse(self) -> Placement:
        """Return the placement of the parent frame in this frame."""
        back = self.turn.inv()
        return Placement(-back.apply(self.origin), back)
