# SPDX-License-Identifier: Apache-2.0
"""Poses, whose rotation vectors may exceed half a turn, and conversions from and to quaternions."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
        """The rotation matrix, by Rodrigues' formula; SciPy takes longer for it than a whole step of a small body."""
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


NO_TURN = 1e-9
"""Angle [rad] below which the axis of a rotation is not defined."""


def nearest_turn(quaternion: Sequence[float], reference: Pose) -> tuple[float, float, float]:
    """Return the rotation vector [rad] of a quaternion (x, y, z, w) that is closest to the rotation of ``reference``.

    A quaternion does not distinguish rotations that differ by 360 degrees. Of their rotation vectors, the vector
    closest to ``reference`` is chosen, so that a handle can rotate any number of times. The code uses plain floats,
    because numpy takes ten times as long for four numbers.
    """
    x, y, z, w = map(float, quaternion)
    sine = math.hypot(x, y, z)
    # Both signs of a quaternion are one rotation; the one with w >= 0 rotates by at most 180 degrees.
    angle = 2.0 * math.atan2(sine, abs(w))
    axis, length = (1.0, 0.0, 0.0), math.hypot(*reference.rotation)
    if angle > NO_TURN:
        sign = math.copysign(1.0 / sine, w)
        axis = (sign * x, sign * y, sign * z)
    elif length > NO_TURN:
        axis = tuple(part / length for part in reference.rotation)
    reach = sum(turn * part for turn, part in zip(reference.rotation, axis, strict=True))
    whole = angle + 2.0 * math.pi * round((reach - angle) / (2.0 * math.pi))
    return (whole * axis[0], whole * axis[1], whole * axis[2])


def quaternion_of(rotation: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) of a rotation matrix, by Shepperd's method, in plain floats."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    squares = (1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i, 1.0 + a + e + i)
    largest = max(range(4), key=squares.__getitem__)
    rows = (
        (squares[0], b + d, c + g, h - f),
        (b + d, squares[1], f + h, c - g),
        (c + g, f + h, squares[2], d - b),
        (h - f, c - g, d - b, squares[3]),
    )
    length = math.hypot(*rows[largest])
    x, y, z, w = (part / length for part in rows[largest])
    return x, y, z, w
