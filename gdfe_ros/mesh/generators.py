# SPDX-License-Identifier: Apache-2.0
"""Meshes generated from a few parameters."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.mesh import HexMesh
from gdfe_ros.mesh.selection import Where, select_cells


def bar(size: Sequence[float], cells: Sequence[int]) -> HexMesh:
    """Mesh a straight bar along x. It starts at x = 0; y and z are centred on 0.

    Args:
        size: length, width, height [m], each > 0.
        cells: number of cells (nx, ny, nz) along each axis, each >= 1.

    Returns:
        The mesh; vertex (i, j, k) has the index i + (nx+1) * (j + (ny+1) * k), cell (i, j, k) the index
        i + nx * (j + ny * k).

    Example:
        >>> bar([0.5, 0.05, 0.05], [50, 5, 5]).n_cells
        1250
    """
    lower = np.array([0.0, -0.5, -0.5]) * size
    axes = (low + length * np.arange(n + 1) / n for low, length, n in zip(lower, size, cells, strict=True))
    return grid(*axes)


def grid(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> HexMesh:
    """Mesh a block that planes perpendicular to x, y and z divide into cells; numbering as for `bar`.

    Args:
        x: coordinates of the planes perpendicular to x [m], strictly ascending, at least two.
        y: coordinates of the planes perpendicular to y [m], likewise.
        z: coordinates of the planes perpendicular to z [m], likewise.

    Raises:
        MeshError: an axis has fewer than two planes, or planes that are not finite or not strictly ascending.
    """
    defects = [
        f"grid.{name} = {list(planes)!r}: allowed: two or more planes, strictly ascending [m]"
        for name, planes in {"x": x, "y": y, "z": z}.items()
        if len(planes) < 2 or not np.all(np.diff(planes) > 0)
    ]
    if defects:
        raise MeshError("cannot mesh this grid", defects)
    across_z, across_y, across_x = np.meshgrid(z, y, x, indexing="ij")
    vertices = np.stack([across_x.ravel(), across_y.ravel(), across_z.ravel()], axis=1)
    return HexMesh(vertices=vertices, cells=grid_cells(len(x) - 1, len(y) - 1, len(z) - 1))


def cut(mesh: HexMesh, holes: Sequence[Where]) -> HexMesh:
    """Remove cells from a mesh: a cavity, a notch, a window.

    Args:
        mesh: the mesh.
        holes: selections of the cells to remove; boxes and spheres select cells by their centroids.

    Raises:
        MeshError: a hole selects no cell (the error names all such holes), or no cell is left.
    """
    keep = np.ones(mesh.n_cells, dtype=bool)
    defects = []
    for i, hole in enumerate(holes):
        cells = select_cells(mesh, hole)
        keep[cells] = False
        if len(cells) == 0:
            defects.append(f"cut {i} ({hole.chosen[1]}) removes no cell: no cell has its centroid there")
    if not keep.any():
        defects.append("the cuts leave no cell")
    if defects:
        raise MeshError("cannot cut this mesh", defects)
    return keep_cells(mesh, keep)


def grid_cells(nx: int, ny: int, nz: int) -> NDArray[np.int32]:
    """Return the cells of a structured grid.

    Args:
        nx: number of cells along the first axis.
        ny: number of cells along the second axis.
        nz: number of cells along the third axis.

    Returns:
        Vertex ids, shape (nx*ny*nz, 8), int32, in the numbering of `bar`.
    """
    k, j, i = np.meshgrid(np.arange(nz), np.arange(ny), np.arange(nx), indexing="ij")
    row, layer = nx + 1, (nx + 1) * (ny + 1)
    first = (i + row * j + layer * k).ravel()
    bottom = np.array([0, 1, 1 + row, row])
    return (first[:, None] + np.concatenate([bottom, bottom + layer])).astype(np.int32)


def finger(size: Sequence[float], *, joints: int, gap: float, web: float, cell: float, taper: float = 1.0) -> HexMesh:
    """Mesh a finger: a bar along x with notches cut from below. It starts at x = 0; y and z are centred on 0.

    Args:
        size: length, width, height at the base [m].
        joints: number of notches, evenly spaced, so that there are joints + 1 links.
        gap: width of each notch along x [m].
        web: height of the material left above each notch [m].
        cell: largest edge of a cell [m].
        taper: width and height at the tip divided by width and height at the base, in (0, 1].

    Returns:
        The mesh with the cell sets links and joints (the webs) and the vertex sets base and tip (the ends).

    Raises:
        MeshError: the gaps do not fit into the length, or the web into the height.
    """
    length, width, height = size
    link = (length - joints * gap) / (joints + 1)
    defects = []
    if link <= 0:
        defects.append(f"finger.gap = {gap!r}: allowed: {joints} gaps shorter than the length {length:g}")
    if web >= height:
        defects.append(f"finger.web = {web!r}: allowed: less than the height {height:g}")
    if defects:
        raise MeshError("cannot mesh this finger", defects)
    x = _planes(np.cumsum([0.0, *([link, gap] * joints), link]), cell)
    z = _planes(np.array([-height / 2, height / 2 - web, height / 2]), cell)
    block = grid(x, _planes(np.array([-width / 2, width / 2]), cell), z)
    in_gap = block.centroids[:, 0] % (link + gap) > link
    above = block.centroids[:, 2] > height / 2 - web
    sets = {"links": np.flatnonzero(~in_gap), "joints": np.flatnonzero(in_gap & above)}
    ends = {"base": block.vertices[:, 0] == x[0], "tip": block.vertices[:, 0] == x[-1]}
    vertices = block.vertices * 1.0
    vertices[:, 1:] *= (1 - (1 - taper) * vertices[:, :1] / length) if taper < 1 else 1.0
    mesh = HexMesh(vertices, block.cells, sets, {name: np.flatnonzero(mask) for name, mask in ends.items()})
    return keep_cells(mesh, ~in_gap | above)


def _planes(borders: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Return ascending coordinates of planes: the borders, and planes between them at most ``cell`` apart [m]."""
    pieces = [borders[:1]]
    for low, high in pairwise(borders):
        count = max(1, int(np.ceil((high - low) / cell - 1e-9)))
        pieces.append(np.linspace(low, high, count + 1)[1:])
    return np.concatenate(pieces)
