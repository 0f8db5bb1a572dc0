# SPDX-License-Identifier: Apache-2.0
"""Elements in blocks of eight lanes with one law, and the rows of a block's scratch array.

This layout lets the element kernels use SIMD. The entry of row r and lane l has the index ``r * LANES + l`` in a flat
array. The constant strides let LLVM prove that the lanes are independent. It then uses SIMD for every loop over lanes
that accesses no second array.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined
from gdfe_ros.mesh.cells.operators import ShapeOperators
from gdfe_ros.mesh.cells.tet_operators import TetOperators
from gdfe_ros.solver.elements.hourglass import couplings
from gdfe_ros.solver.vectors import NEGLIGIBLE, Array

LANES = 8
"""Number of elements in a block. The innermost loops run over the elements of a block."""
REFERENCE, AXES, EDGES, VOLUME, COUPLING, GEOMETRY_ROWS = 0, 9, 18, 21, 22, 23
"""First row of each quantity in the `Blocks.geometry` of hexahedra: inverse of dX/dxi (9 rows), edge directions (9
rows), 2 / edge length (3 rows), volume (1 row), and coupling of shear strains in torsion (1 row); then the number of
all rows.
"""


class Blocks(NamedTuple):
    """The elements in blocks of one law and one shape, parallelepiped or not; the last block of a kind is padded.

    Attributes:
        element: (b, LANES) int32 element of each lane.
        used: (b,) int32 number of lanes in use; the other lanes repeat the first lane.
        law: (b,) int32 law of the block's elements.
        parallel: (b,) bool, whether all elements of the block are parallelepipeds; False for tetrahedra.
        geometry: (b * g * LANES,) float64, the g rows of each block (`CellType.geometry`); a row has one number for
            each lane.
    """

    element: NDArray[np.int32]
    used: NDArray[np.int32]
    law: NDArray[np.int32]
    parallel: NDArray[np.bool_]
    geometry: Array


def make_blocks(
    geometry: Array, law: NDArray[np.int32], parallel: NDArray[np.bool_], elements: NDArray[np.int32]
) -> Blocks:
    """Return the ``elements`` (k,) in blocks, sorted by law and by whether they are parallelepipeds.

    Elements of the same kind keep their order. ``geometry`` (m, g), ``law`` (m,) and ``parallel`` (m,) have entries for
    all elements of the body.
    """
    element, used = lanes_of((2 * law + parallel)[elements], elements)
    first = element[:, 0]
    return Blocks(element, used, law[first], parallel[first], in_lanes(geometry, element))


def in_lanes(rows: Array, element: NDArray[np.int32]) -> Array:
    """Return the ``rows`` (m, g) of the elements (b, LANES) in the layout of ``Blocks.geometry``."""
    return np.ascontiguousarray(rows[element].transpose(0, 2, 1)).ravel()


def lanes_of(kind: NDArray[np.int32], elements: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the ``elements`` (k,), sorted by their ``kind`` (k,), in lanes (b, LANES), and the lanes in use (b,).

    The second result is the number of lanes that each block uses.
    """
    rows, used = [], []
    for value in np.unique(kind):
        members = elements[kind == value]
        for start in range(0, len(members), LANES):
            lanes = members[start : start + LANES]
            used.append(len(lanes))
            rows.append(np.concatenate([lanes, np.full(LANES - len(lanes), lanes[0], np.int32)]))
    return np.array(rows, dtype=np.int32).reshape(-1, LANES), np.array(used, dtype=np.int32)


def hex_geometry(shape: ShapeOperators) -> Array:
    """Return the rows from `REFERENCE` to `COUPLING` of hexahedra (m, GEOMETRY_ROWS)."""
    directions, lengths = shape.edge_axes.reshape(-1, 9), 2.0 / shape.edge_lengths
    across = shape.volume[:, None], couplings(shape.across)[:, None]
    return np.concatenate([shape.reference.reshape(-1, 9), directions, lengths, *across], axis=1)


@dataclass(frozen=True, eq=False)
class Operators:
    """The elements' rest shape; an immutable value.

    Attributes:
        shape: operators of the elements.
        blocks: the same operators in the layout of the kernels' blocks.
        stretch: (k, 3, 3) growth of the cells that can grow; (0, 3, 3) if none can.
    """

    shape: ShapeOperators
    blocks: Blocks
    stretch: Array


COORDINATES, GRADIENT, MODES, STRESS, FORCES = 0, 24, 33, 45, 54
"""First row of each quantity in a block's scratch array: corner coordinates (24 rows, x then y then z; the corner
forces overwrite them), F (9 rows), hourglass vectors q (4 x 3 rows), stress P or V P (9 rows), and hourglass forces (4
x 3 rows).
"""
ENERGY, PRESSURE, SHEAR_ROW, LAME_ROW, PENALTY_ROW, YOUNG_ROW, SCALED_SHEAR, POISSON_ROW = range(66, 74)
GEOMETRY = POISSON_ROW + 1
"""First of the 23 rows with a copy of `Blocks.geometry`."""
ROWS = GEOMETRY + GEOMETRY_ROWS


@inlined
def load3(b, row, lane):
    """Return the lane's three numbers in the rows from ``row`` on."""
    i = row * LANES + lane
    return b[i], b[i + LANES], b[i + 2 * LANES]


@inlined
def load6(b, row, lane):
    """Return the lane's six numbers in the rows from ``row`` on."""
    return load3(b, row, lane) + load3(b, row + 3, lane)


@inlined
def load9(b, row, lane):
    """Return the lane's nine numbers in the rows from ``row`` on."""
    return load3(b, row, lane) + load3(b, row + 3, lane) + load3(b, row + 6, lane)


@inlined
def store3(b, row, lane, v):
    """Write the lane's three numbers ``v`` in the rows from ``row`` on."""
    i = row * LANES + lane
    b[i], b[i + LANES], b[i + 2 * LANES] = v


@inlined
def store9(b, row, lane, v):
    """Write the lane's nine numbers ``v`` in the rows from ``row`` on."""
    store3(b, row, lane, v[:3])
    store3(b, row + 3, lane, v[3:6])
    store3(b, row + 6, lane, v[6:])


@inlined
def load_geometry(b, geometry, block, first, count):
    """Copy the ``count`` rows of a block's geometry into the rows from ``first`` on."""
    for i in range(count * LANES):
        b[first * LANES + i] = geometry[block * count * LANES + i]


@inlined
def load_nodes(b, x, cells, elements, first, count):
    """Copy the coordinates of a block's ``count`` nodes, all x, then y, then z, into the rows from ``first`` on."""
    for lane in range(LANES):
        e = elements[lane]
        for a in range(count):
            v = cells[e, a]
            for axis in range(3):
                b[(first + count * axis + a) * LANES + lane] = x[v, axis]


@inlined
def store_nodes(b, force, elements, used, first, count):
    """Copy node forces of a block's ``used`` lanes to ``force`` (m, c, 3) [N]; their rows begin at ``first``."""
    for lane in range(used):
        e = elements[lane]
        for a in range(count):
            for axis in range(3):
                force[e, a, axis] = b[(first + count * axis + a) * LANES + lane]


INVERSE, WEIGHT, TET_GEOMETRY_ROWS = 0, 36, 40
"""First rows in the `Blocks.geometry` of tetrahedra: inverses of dX/dxi (4 x 9 rows) and weights (4 rows) of the
integration points; then the number of all rows.
"""
NODES, TOTAL, GRADIENTS = ROWS, ROWS + 30, ROWS + 60
"""First rows of the node coordinates (3 x 10 rows), of the node forces (3 x 10 rows), and of F at the integration
points (4 x 9 rows). They follow the rows of hexahedra, which a tetrahedron uses, too, to evaluate its law.
"""
SLOPE, STORED_ENERGY, GEOMETRY_OF_TET = GRADIENTS + 36, GRADIENTS + 37, GRADIENTS + 38
"""Row of the pressure that acts on the mean volume, row of the energy, and first of the 40 rows of the geometry."""
TET_ROWS = GEOMETRY_OF_TET + TET_GEOMETRY_ROWS


def tet_geometry(shape: TetOperators) -> Array:
    """Return the rows `INVERSE` and `WEIGHT` of tetrahedra (m, TET_GEOMETRY_ROWS)."""
    inverse = shape.inverse.reshape(-1, 4, 9)
    bend = np.abs(inverse - inverse[:, :1]).max(axis=(1, 2), keepdims=True)
    straight = bend <= NEGLIGIBLE * np.abs(inverse[:, :1]).max(axis=2, keepdims=True)
    inverse = np.where(straight, inverse[:, :1], inverse)  # without its rounding
    return np.concatenate([inverse.reshape(-1, 36), shape.weight], axis=1)
