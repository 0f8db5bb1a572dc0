# SPDX-License-Identifier: Apache-2.0
"""Conversion of a quaternion to a rotation vector that continues a handle's earlier rotation."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gdfe_ros.constraints.pose import Pose

NO_TURN = 1e-9
"""Angle [rad] below which the axis of a rotation is not defined."""


def nearest_turn(quaternion: Sequence[float], reference: Pose) -> tuple[float, float, float]:
    """Return the rotation vector [rad] of a quaternion (x, y, z, w) that is closest to the rotation of ``reference``.

    A pose message does not distinguish a rotation from the same rotation plus 360 degrees. Of these rotation vectors,
    the vector closest to the present one is chosen, so that a handle can rotate any number of times. The code uses
    plain floats, because numpy takes ten times as long for four numbers.
    """
    x, y, z, w = map(float, quaternion)
    sine = math.hypot(x, y, z)
    # Both signs of a quaternion are one rotation; the one with w >= 0 rotates by at most 180 degrees.
    angle = 2.0 * math.atan2(sine, abs(w))
    axis = _direction(reference)
    if angle > NO_TURN:
        sign = math.copysign(1.0 / sine, w)
        axis = (sign * x, sign * y, sign * z)
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


def _direction(pose: Pose) -> tuple[float, float, float]:
    length = math.hypot(*pose.rotation)
    if length <= NO_TURN:
        return 1.0, 0.0, 0.0
    x, y, z = pose.rotation
    return x / length, y / length, z / length
