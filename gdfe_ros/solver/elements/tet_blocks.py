# SPDX-License-Identifier: Apache-2.0
"""Quadratic tetrahedra in blocks of one law, eight lanes wide, and the rows of their scratch array."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.table import MaterialTable
from gdfe_ros.mesh.tet_operators import TetOperators
from gdfe_ros.solver.elements.blocks import LANES, lanes_of
from gdfe_ros.solver.elements.lanes import ROWS
from gdfe_ros.solver.value import NEGLIGIBLE

INVERSE, WEIGHT, TET_GEOMETRY_ROWS = 0, 36, 40
"""First rows in ``TetBlocks.geometry`` of the inverses of dX/dxi (4 x 9) and the weights (4) of the integration points;
and the number of rows."""
NODES, TOTAL, GRADIENTS = ROWS, ROWS + 30, ROWS + 60
"""First rows of the node coordinates (10 x 3), of the node forces (10 x 3), and of F at the points (4 x 9). The rows of
hexahedra come before them, because the laws are evaluated in the rows of hexahedra.
"""
SLOPE, STORED_ENERGY, GEOMETRY_OF_TET = GRADIENTS + 36, GRADIENTS + 37, GRADIENTS + 38
"""Row of the pressure that acts on the mean volume, row of the energy, and first of the geometry's 40 rows."""
TET_ROWS = GEOMETRY_OF_TET + TET_GEOMETRY_ROWS


class TetBlocks(NamedTuple):
    """The elements in blocks, sorted by law and straight or curved edges; the last block of a kind is padded.

    Attributes:
        element: (b, LANES) int32 element of each lane.
        used: (b,) int32 number of lanes in use; the other lanes repeat the first lane.
        law: (b,) int32 law of the block's elements.
        straight: (b,) bool, whether all edges of the block are straight. One inverse and one weight then serve all four
            integration points.
        start: (b,) int64 index in ``geometry`` at which each block begins.
        geometry: float64, the rows `INVERSE` and `WEIGHT` of each block; a row has one number for each lane. Straight
            blocks have one inverse (9) and one weight only: a quarter of the numbers, because memory limits the
            kernels.
    """

    element: NDArray[np.int32]
    used: NDArray[np.int32]
    law: NDArray[np.int32]
    straight: NDArray[np.bool_]
    start: NDArray[np.int64]
    geometry: NDArray[np.float64]


def make_tet_blocks(
    shape: TetOperators, material: NDArray[np.int32], table: MaterialTable, elements: NDArray[np.int32]
) -> TetBlocks:
    """Return the ``elements`` (k,) in blocks, sorted by law and edge shape; within a kind the order is kept."""
    inverse = shape.inverse.reshape(-1, 4, 9)
    bend = np.abs(inverse - inverse[:, :1]).max(axis=(1, 2))
    straight = bend <= NEGLIGIBLE * np.abs(inverse[:, 0]).max(axis=1)
    element, used = lanes_of((2 * table.law[material] + straight)[elements], elements)
    kind = straight[element[:, 0]]
    sizes = LANES * np.where(kind, TET_GEOMETRY_ROWS // 4, TET_GEOMETRY_ROWS)
    start = np.cumsum([0, *sizes])[:-1]
    blocks = TetBlocks(element, used, table.law[material[element[:, 0]]], kind, start, np.zeros(0))
    return blocks._replace(geometry=tet_geometry(shape, blocks))


def tet_geometry(shape: TetOperators, blocks: TetBlocks) -> NDArray[np.float64]:
    """Return the array ``TetBlocks.geometry`` of elements that are already in blocks."""
    inverse = shape.inverse.reshape(-1, 4, 9)
    whole = np.concatenate([shape.inverse.reshape(-1, 36), shape.weight], axis=1)
    short = np.concatenate([inverse[:, 0], shape.weight[:, :1]], axis=1)
    rows = [(short if blocks.straight[b] else whole)[lanes].T.ravel() for b, lanes in enumerate(blocks.element)]
    return np.concatenate([np.zeros(0), *rows])
