# SPDX-License-Identifier: Apache-2.0
"""Interpolation between the points of a trajectory, as joint_trajectory_controller interpolates."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Table = NDArray[np.float64]


def spline(
    times: Sequence[float], values: Table, slopes: Table | None = None, bends: Table | None = None, *, at: float
) -> NDArray[np.float64]:
    """Return the positions (n,) of a trajectory at a time.

    The interpolation is linear for points with positions only, cubic with velocities, and quintic with velocities and
    accelerations. Before the first point and after the last point, the positions are constant.

    Args:
        times: (k,) ascending [s].
        values: positions (k, n).
        slopes: velocities (k, n); None if the points have none.
        bends: accelerations (k, n), only together with velocities; None if the points have none.
        at: time [s] of the result.
    """
    place = bisect_right(times, at) - 1
    if place < 0 or place >= len(times) - 1:
        return values[0 if place < 0 else -1].copy()
    h = times[place + 1] - times[place]
    s = (at - times[place]) / h
    a, b = values[place], values[place + 1]
    if slopes is None:
        return a + s * (b - a)
    u, v = h * slopes[place], h * slopes[place + 1]
    if bends is None:
        return a + s * (u + s * (3.0 * (b - a) - 2.0 * u - v + s * (2.0 * (a - b) + u + v)))
    p, q = 0.5 * h**2 * bends[place], 0.5 * h**2 * bends[place + 1]
    d = b - a
    third = 10.0 * d - 6.0 * u - 4.0 * v - 3.0 * p + q
    fourth = -15.0 * d + 8.0 * u + 7.0 * v + 3.0 * p - 2.0 * q
    fifth = 6.0 * d - 3.0 * u - 3.0 * v - p + q
    return a + s * (u + s * (p + s * (third + s * (fourth + s * fifth))))
