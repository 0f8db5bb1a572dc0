# SPDX-License-Identifier: Apache-2.0
"""The pose of a handle relative to its rest pose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, sin, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
        return (points - centre) @ self._matrix.T + (centre + np.asarray(self.translation))

    def turn_from(self, other: Pose) -> NDArray[np.float64]:
        """Return the matrix (3, 3) of the rotation from the other pose to this one."""
        return self._matrix @ other._matrix.T

    @cached_property
    def _matrix(self) -> NDArray[np.float64]:
        """The rotation matrix, by Rodrigues' formula; SciPy's takes longer than a small body's whole step."""
        x, y, z = self.rotation
        square = x * x + y * y + z * z
        angle = sqrt(square)
        a, b = (sin(angle) / angle, 2.0 * (sin(0.5 * angle) / angle) ** 2) if square > 0.0 else (1.0, 0.5)
        return np.array(
            [
                [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
                [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
                [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
            ]
        )

    def blend(self, other: Pose, fraction: float) -> Pose:
        """Return a pose between this pose (``fraction`` 0) and the other pose (1).

        The translation and the rotation vector are interpolated linearly.
        """
        pairs = (self.translation, other.translation), (self.rotation, other.rotation)
        return Pose(*(tuple(a + fraction * (b - a) for a, b in zip(*pair, strict=True)) for pair in pairs))
