# SPDX-License-Identifier: Apache-2.0
"""Rows of a block's scratch array, and loads and stores of tuples.

The entry of row r and lane l has the index ``r * LANES + l`` in a flat array. The constant strides let LLVM prove that
the lanes are independent. It then uses SIMD for every loop over lanes that accesses no second array.
"""

from __future__ import annotations

from gdfe_ros.compiled import inlined
from gdfe_ros.solver.elements.blocks import GEOMETRY_ROWS, LANES

COORDINATES = 0
"""First of 24 rows of corner coordinates, x then y then z. The corner forces overwrite them."""
GRADIENT, MODES, STRESS, FORCES = 24, 33, 45, 54
"""First rows of F (9), hourglass vectors q (4 x 3), stress P or V P (9), and hourglass forces (4 x 3)."""
ENERGY, PRESSURE, SHEAR_ROW, LAME_ROW, PENALTY_ROW, YOUNG_ROW, SCALED_SHEAR, POISSON_ROW = range(66, 74)
GEOMETRY = 74
"""First of the rows of ``Blocks.geometry`` (23)."""
ROWS = GEOMETRY + GEOMETRY_ROWS


@inlined
def load3(b, row, lane):
    """Return the lane's three numbers in the rows from ``row`` on."""
    i = row * LANES + lane
    return b[i], b[i + LANES], b[i + 2 * LANES]


@inlined
def load6(b, row, lane):
    """Return the lane's six numbers in the rows from ``row`` on."""
    i = row * LANES + lane
    return b[i], b[i + LANES], b[i + 2 * LANES], b[i + 3 * LANES], b[i + 4 * LANES], b[i + 5 * LANES]


@inlined
def load9(b, row, lane):
    """Return the lane's nine numbers in the rows from ``row`` on."""
    i = row * LANES + lane
    return (
        b[i],
        b[i + LANES],
        b[i + 2 * LANES],
        b[i + 3 * LANES],
        b[i + 4 * LANES],
        b[i + 5 * LANES],
        b[i + 6 * LANES],
        b[i + 7 * LANES],
        b[i + 8 * LANES],
    )


@inlined
def store3(b, row, lane, v):
    """Write the lane's three numbers ``v`` in the rows from ``row`` on."""
    i = row * LANES + lane
    b[i], b[i + LANES], b[i + 2 * LANES] = v


@inlined
def store9(b, row, lane, v):
    """Write the lane's nine numbers ``v`` in the rows from ``row`` on."""
    i = row * LANES + lane
    b[i], b[i + LANES], b[i + 2 * LANES] = v[0], v[1], v[2]
    b[i + 3 * LANES], b[i + 4 * LANES], b[i + 5 * LANES] = v[3], v[4], v[5]
    b[i + 6 * LANES], b[i + 7 * LANES], b[i + 8 * LANES] = v[6], v[7], v[8]
