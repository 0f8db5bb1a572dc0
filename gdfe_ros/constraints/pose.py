# SPDX-License-Identifier: Apache-2.0
"""The pose of a handle relative to its rest pose."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

_ZERO = (0.0, 0.0, 0.0)
_MEANING = {
    "translation": "allowed: [x, y, z] in m",
    "rotation": "allowed: a rotation vector, axis times angle in rad; remedy for a quaternion or a matrix: "
    "scipy's Rotation.from_quat([x, y, z, w]).as_rotvec(), Rotation.from_matrix(m).as_rotvec()",
}


@dataclass(frozen=True)
class Pose:
    """Translation of a handle, and rotation about its centre, relative to the rest pose.

    Attributes:
        translation: displacement of the handle's centre [m].
        rotation: rotation vector [rad]; its length may exceed 180 degrees.

    Raises:
        ValueError: a component is not a finite number.
    """

    translation: tuple[float, float, float] = _ZERO
    rotation: tuple[float, float, float] = _ZERO

    def __post_init__(self) -> None:
        for name in ("translation", "rotation"):
            given = getattr(self, name)
            try:
                values = tuple(map(float, given))
            except (TypeError, ValueError):
                values = ()
            if len(values) != 3 or not all(map(isfinite, values)):
                raise ValueError(f"{name} must be three finite numbers, got {given!r}; {_MEANING[name]}")
            object.__setattr__(self, name, values)

    def apply(self, points: ArrayLike, centre: ArrayLike) -> NDArray[np.float64]:
        """Return the moved positions (k, 3) [m] of ``points`` (k, 3) [m] given in the rest pose.

        ``centre`` (3,) [m] is the handle's centre in the rest pose.
        """
        points, centre = np.asarray(points, dtype=np.float64), np.asarray(centre, dtype=np.float64)
        if self.rotation == _ZERO:
            return points + np.asarray(self.translation)
        turned = Rotation.from_rotvec(self.rotation).apply(points - centre)
        return turned + centre + np.asarray(self.translation)

    def blend(self, other: Pose, fraction: float) -> Pose:
        """Return a pose between this pose (``fraction`` 0) and the other pose (1).

        The translation and the rotation vector are interpolated linearly.
        """
        pairs = (self.translation, other.translation), (self.rotation, other.rotation)
        return Pose(*(tuple(a + fraction * (b - a) for a, b in zip(*pair, strict=True)) for pair in pairs))
