# SPDX-License-Identifier: Apache-2.0
"""Compiled distances between two sets of positions, without intermediate arrays."""

from __future__ import annotations

import math

from gdfe_ros.compiled import kernel


@kernel
def largest_shift(a, b):
    """Return the largest difference of a coordinate between ``a`` and ``b`` (n, 3) [m]; NaN if either contains NaN."""
    most = 0.0
    for i in range(len(a)):
        for axis in range(3):
            shift = abs(a[i, axis] - b[i, axis])
            if math.isnan(shift):
                return shift
            most = max(most, shift)
    return most


@kernel
def largest_distance(a, b):
    """Return the largest distance between rows of ``a`` and ``b`` (n, 3) [m]; NaN if either contains NaN."""
    most = 0.0
    for i in range(len(a)):
        square = (a[i, 0] - b[i, 0]) ** 2 + (a[i, 1] - b[i, 1]) ** 2 + (a[i, 2] - b[i, 2]) ** 2
        if math.isnan(square):
            return square
        most = max(most, square)
    return math.sqrt(most)


@kernel
def largest(step):
    """Return the length [m] of the longest row of ``step`` (3 r,), a displacement of the unknowns."""
    most = 0.0
    for i in range(0, len(step), 3):
        most = max(most, step[i] ** 2 + step[i + 1] ** 2 + step[i + 2] ** 2)
    return math.sqrt(most)
