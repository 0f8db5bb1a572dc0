# SPDX-License-Identifier: Apache-2.0
"""Interpolation between the points of a trajectory, as joint_trajectory_controller interpolates."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Table = NDArray[np.float64]
RANGE_ROUNDING = 1e-9
"""Part of a range by which rounding may exceed it between two points."""
_HALVINGS = 40
"""Number of bisections of an interval with a root, whose error is then 1e-12 of a segment."""


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
    tables = [None if table is None else table[place : place + 2] for table in (values, slopes, bends)]
    return _evaluate(_coefficients(h, *tables), (at - times[place]) / h)


def find_excess(
    times: Table, values: Table, slopes: Table | None = None, bends: Table | None = None, *, low: Table, high: Table
) -> tuple[int, float, float] | None:
    """Return where a trajectory leaves its limits most between its points: column, time [s] and position.

    The positions at the points themselves are not checked. Between points with positions only, there is no excess.

    Args:
        times: as for ``spline``.
        values: as for ``spline``.
        slopes: as for ``spline``.
        bends: as for ``spline``.
        low: least positions (n,).
        high: largest positions (n,).

    Returns:
        None if the trajectory exceeds its limits by no more than `RANGE_ROUNDING`.
    """
    h = np.diff(times)[:, None]
    pairs = (None if table is None else (table[:-1], table[1:]) for table in (values, slopes, bends))
    with np.errstate(over="ignore", invalid="ignore"):  # of huge velocities; their extremes are not finite
        coefficients = [np.asarray(each)[:, None] for each in _coefficients(h, *pairs)]
        places = _roots([power * each for power, each in enumerate(coefficients)][1:])
        positions = _evaluate(coefficients, places)
        span = np.where(np.isfinite(high - low), high - low, np.abs(values).max(axis=0))
        excess = np.maximum(low - positions, positions - high)
    wrong = ~(np.isfinite(positions) & (excess <= RANGE_ROUNDING * span))
    if not wrong.any():
        return None
    worst = np.unravel_index(np.argmax(np.where(wrong, excess, -np.inf)), excess.shape)
    return int(worst[-1]), float(times[worst[0]] + h[worst[0], 0] * places[worst]), float(positions[worst])


def _coefficients(h: Any, values: Any, slopes: Any = None, bends: Any = None) -> list[Table]:
    """Return the coefficients of powers of s = 0 .. 1 between two points ``h`` [s] apart, from both points' data."""
    a, b = values
    if slopes is None:
        return [a, b - a]
    u, v = h * slopes[0], h * slopes[1]
    if bends is None:
        return [a, u, 3.0 * (b - a) - 2.0 * u - v, 2.0 * (a - b) + u + v]
    p, q = 0.5 * h**2 * bends[0], 0.5 * h**2 * bends[1]
    d = b - a
    third = 10.0 * d - 6.0 * u - 4.0 * v - 3.0 * p + q
    fourth = -15.0 * d + 8.0 * u + 7.0 * v + 3.0 * p - 2.0 * q
    fifth = 6.0 * d - 3.0 * u - 3.0 * v - p + q
    return [a, u, p, third, fourth, fifth]


def _evaluate(coefficients: Sequence[Table], s: Any) -> Table:
    """Return the polynomial with these coefficients, the constant first, at ``s``."""
    value = coefficients[-1]
    for each in coefficients[-2::-1]:
        value = each + s * value
    return value


def _roots(coefficients: Sequence[Table]) -> Table:
    """Return numbers of 0 .. 1 among which are all roots of polynomials there, one for each power, along axis 1.

    A root is found by bisection between two successive roots of the derivative. Without a root there, it is an end.

    Args:
        coefficients: coefficients (k, 1, n) of each power, the constant first.
    """
    first = coefficients[0]
    if len(coefficients) == 1:
        return np.zeros((len(first), 0, first.shape[-1]))
    inner = _roots([power * each for power, each in enumerate(coefficients)][1:])
    ends = np.concatenate([np.zeros_like(first), inner, np.ones_like(first)], axis=1)
    low, high = ends[:, :-1], ends[:, 1:]
    sign = np.sign(_evaluate(coefficients, low))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        before = sign * _evaluate(coefficients, middle) > 0.0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return 0.5 * (low + high)
