# SPDX-License-Identifier: Apache-2.0
"""Content of a mesh file with cells of all kinds, and its named sets of cells and points."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
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


Sets = dict[str, NDArray[np.int32]]
#: Whole-number data with more distinct values than this do not define groups; they are taken as item numbers.
MOST_GROUPS = 256

_PHYSICAL = "gmsh:physical"


def read_sets(raw: RawMesh, starts: dict[int, int]) -> tuple[Sets, Sets]:
    """Return the cell sets and the vertex sets of a file.

    Args:
        raw: content of the file.
        starts: dict from the index of each block of solid cells to the index of its first cell in the mesh.

    Returns:
        Two dicts from set name to sorted ids, int32: sets of solid cells, and sets of vertices. A group of faces, edges
        or points becomes a set of its vertices. Whole-number data ``name`` become one set for each value except zero:
        ``name_1``, ``name_2``, ...
    """
    cells: dict[str, list[NDArray[np.int64]]] = defaultdict(list)
    vertices: dict[str, list[NDArray[np.int64]]] = defaultdict(list)
    for name, block, ids in _block_groups(raw):
        if block in starts:
            cells[name].append(starts[block] + ids)
        else:
            vertices[name].append(np.unique(np.asarray(raw.cells[block].data)[ids]))
    for name, ids in raw.point_sets.items():
        vertices[str(name)].append(np.asarray(ids, dtype=np.int64))
    for name, data in raw.point_data.items():
        for value in _groups(np.asarray(data)):
            vertices[f"{name}_{value}"].append(np.flatnonzero(np.asarray(data) == value))
    return _join(cells), _join(vertices)


def _block_groups(raw: RawMesh) -> Iterator[tuple[str, int, NDArray[np.int64]]]:
    """Yield each set or group of cells block by block: its name, the block's index, and the cells' indices in it."""
    for name, per_block in raw.cell_sets.items():
        for block, ids in enumerate(per_block if name and not name.startswith("gmsh:") else ()):
            if ids is not None and len(ids):
                yield name, block, np.asarray(ids, dtype=np.int64)
    for key, per_block in raw.cell_data.items():
        whole = np.concatenate([np.asarray(data).ravel() for data in per_block]) if per_block else np.zeros(0)
        for value in [] if key == "gmsh:geometrical" else _groups(whole):
            yield from _value_blocks(raw, key, value)


def _value_blocks(raw: RawMesh, key: str, value: int) -> Iterator[tuple[str, int, NDArray[np.int64]]]:
    """Yield the group of the cells whose data ``key`` are ``value``, as `_block_groups` does."""
    names = {(int(tag), int(dim)): name for name, (tag, dim) in raw.field_data.items()}
    for block, data in enumerate(raw.cell_data[key]):
        name = f"{key}_{value}"
        if key == _PHYSICAL:
            name = names.get((value, raw.cells[block].dim), f"physical_{value}")
        ids = np.flatnonzero(np.asarray(data) == value)
        if len(ids) and not (key == _PHYSICAL and name in raw.cell_sets):
            yield name, block, ids


def _groups(data: NDArray[np.generic]) -> list[int]:
    """Return the distinct nonzero values of whole-number data, or none if there are more than `MOST_GROUPS`."""
    if data.ndim != 1 or not np.issubdtype(data.dtype, np.integer):
        return []
    values = [int(value) for value in np.unique(data) if value]
    return values if len(values) <= MOST_GROUPS else []


def _join(found: dict[str, list[NDArray[np.int64]]]) -> Sets:
    return {name: np.unique(np.concatenate(ids)).astype(np.int32) for name, ids in found.items()}
