# SPDX-License-Identifier: Apache-2.0
"""Content of a mesh file before its cells are chosen: points, blocks of cells, sets and data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class CellBlock(NamedTuple):
    """Cells of one kind.

    Attributes:
        type: name of the kind as in meshio, e.g. ``tetra10``.
        data: ids of the points of each cell (m, c), in VTK's order.
        dim: dimension of the cells, 0 to 3.
    """

    type: str
    data: NDArray[np.integer]
    dim: int = 3


@dataclass(eq=False, kw_only=True)
class RawMesh:
    """Content of a mesh file.

    Attributes:
        points: (n, 3), in the file's unit.
        cells: blocks of cells, in the order of the file.
        cell_sets: dict from name to the ids of cells in each block.
        point_sets: dict from name to the ids of points.
        cell_data: dict from name to the values of the cells of each block.
        point_data: dict from name to the values of the points.
        field_data: dict from the name of a physical group of gmsh to its number and dimension.
        remarks: messages about content that was left out.
    """

    points: NDArray[np.float64]
    cells: list[CellBlock]
    cell_sets: dict[str, list[NDArray[np.integer]]] = field(default_factory=dict)
    point_sets: dict[str, NDArray[np.integer]] = field(default_factory=dict)
    cell_data: dict[str, list[NDArray]] = field(default_factory=dict)
    point_data: dict[str, NDArray] = field(default_factory=dict)
    field_data: dict[str, Any] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
