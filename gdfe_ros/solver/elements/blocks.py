# SPDX-License-Identifier: Apache-2.0
"""Elements in blocks of eight lanes with one law: the layout that lets the element kernels use SIMD."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.table import MaterialTable
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.elements.hourglass import couplings

LANES = 8
"""Number of elements in a block. The innermost loops run over the elements of a block."""
REFERENCE, AXES, EDGES, VOLUME, COUPLING, GEOMETRY_ROWS = 0, 9, 18, 21, 22, 23
"""First rows in ``Blocks.geometry`` of five fields: the inverse of dX/dxi (9), edge directions (9), 2 / edge length
(3), volume (1), and coupling of shear strains in torsion (1). The last number counts all rows.
"""


class Blocks(NamedTuple):
    """The elements, sorted by law and shape, in blocks; the last block of a kind is padded by repetition.

    Attributes:
        element: (b, LANES) int32 element of each lane.
        used: (b,) int32 number of lanes in use; the other lanes repeat the first lane.
        law: (b,) int32 law of the block's elements.
        parallel: (b,) bool, whether all elements of the block are parallelepipeds.
        geometry: (b * GEOMETRY_ROWS * LANES,) float64, the rows from `REFERENCE` to `COUPLING` of each block; a row
            has one number for each lane.
    """

    element: NDArray[np.int32]
    used: NDArray[np.int32]
    law: NDArray[np.int32]
    parallel: NDArray[np.bool_]
    geometry: NDArray[np.float64]


def make_blocks(
    shape: ShapeOperators, material: NDArray[np.int32], table: MaterialTable, elements: NDArray[np.int32]
) -> Blocks:
    """Return the ``elements`` (k,) in blocks, sorted by law and shape; within a kind the order is kept."""
    kind = (2 * table.law[material] + shape.parallel)[elements]
    element, used = lanes_of(kind, elements)
    return Blocks(
        element,
        used,
        table.law[material[element[:, 0]]],
        shape.parallel[element[:, 0]],
        block_geometry(shape, element),
    )


def lanes_of(kind: NDArray[np.int32], elements: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the ``elements`` (k,), sorted by kind, in lanes (b, LANES), and each block's number of lanes in use (b,).

    ``kind`` (k,) is the kind of each element.
    """
    rows, used = [], []
    for value in np.unique(kind):
        members = elements[kind == value]
        for start in range(0, len(members), LANES):
            lanes = members[start : start + LANES]
            used.append(len(lanes))
            rows.append(np.concatenate([lanes, np.full(LANES - len(lanes), lanes[0], np.int32)]))
    return np.array(rows, dtype=np.int32).reshape(-1, LANES), np.array(used, dtype=np.int32)


def block_geometry(shape: ShapeOperators, element: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the array ``Blocks.geometry`` for elements (b, LANES)."""
    geometry = np.concatenate(
        [
            shape.reference.reshape(-1, 9),
            shape.edge_axes.reshape(-1, 9),
            2.0 / shape.edge_lengths,
            shape.volume[:, None],
            couplings(shape.across)[:, None],
        ],
        axis=1,
    )
    return np.ascontiguousarray(geometry[element].transpose(0, 2, 1)).ravel()


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
    stretch: NDArray[np.float64]
