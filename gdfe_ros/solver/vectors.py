# SPDX-License-Identifier: Apache-2.0
"""Compiled helpers for vectors: copies of parts of flat vectors, and largest distances.

Kernels use loops instead of slice assignments: numba checks the shapes of slices, and compiling the text of the error
message takes a tenth of a second for each assignment.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, kernel

Array = NDArray[np.float64]
"""Type of arrays of float64."""
NEGLIGIBLE = 1e-9
"""Relative difference, or fraction of a whole, that counts as zero."""


@inlined
def copy_part(target, to, source, at, count):
    """Copy ``count`` numbers of ``source`` from ``at`` on to ``target`` from ``to`` on."""
    for i in range(count):
        target[to + i] = source[at + i]


@inlined
def clear_part(target, to, count):
    """Set ``count`` numbers of ``target`` from ``to`` on to zero."""
    for i in range(count):
        target[to + i] = 0.0


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
