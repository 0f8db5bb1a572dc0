# SPDX-License-Identifier: Apache-2.0
"""Compiled application of the constant matrix' inverse by the supernodes of its factor, for x, y and z at once.

Each supernode's part of the factor is read once for all three right-hand sides. A large factor does not fit into any
cache, and reading it dominates the time of a solve: it is stored in single precision.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import vector_internal, vector_kernel
from gdfe_ros.solver.matrix.substitution import Plan, solve_ordered


class Inverse(NamedTuple):
    """An inverse (f, f) for the kernels; it is never modified, so that threads may use it together.

    Attributes:
        plan: index arrays of the factor.
        order: (f,) vertices in the order of their elimination.
        values: entries of the factor; empty if ``coarse`` is used.
        coarse: these entries in single precision; empty if they are in double precision.
    """

    plan: Plan
    order: NDArray[np.int64]
    values: NDArray[np.float64]
    coarse: NDArray[np.float32]


@vector_kernel
def apply_free(inverse, right, out):
    """Write A_ff^-1 right to the first rows of ``out``, for three right-hand sides (f, 3), flat."""
    if len(inverse.coarse) > 0:
        apply_factor(inverse, inverse.coarse, right, out)
    else:
        apply_factor(inverse, inverse.values, right, out)


@vector_internal
def apply_factor(inverse, values, right, out):
    """Do `apply_free` with the factor's ``values``."""
    count = len(inverse.order)
    columns, local = np.empty((3, count)), np.empty((3, count))
    for i in range(count):
        for axis in range(3):
            columns[axis, i] = right[3 * inverse.order[i] + axis]
    solve_ordered(values, inverse.plan, (0,), columns, local)
    for i in range(count):
        for axis in range(3):
            out[3 * inverse.order[i] + axis] = columns[axis, i]
