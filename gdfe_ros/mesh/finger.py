# SPDX-License-Identifier: Apache-2.0
"""Mesh of a finger: stiff links joined by thin webs, to be bent by a tendon below them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.generators import grid, require_counts, require_sizes
from gdfe_ros.mesh.hexmesh import HexMesh
from gdfe_ros.mesh.subset import keep_cells


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
        MeshError: an argument is out of range.
    """
    require_sizes("finger", {"size": size, "gap": gap, "web": web, "cell": cell})
    require_counts("finger", {"joints": joints})
    length, width, height = size
    link = (length - joints * gap) / (joints + 1)
    defects = []
    if link <= 0:
        defects.append(f"finger.gap = {gap!r}: allowed: {joints} gaps shorter than the length {length:g}")
    if web >= height:
        defects.append(f"finger.web = {web!r}: allowed: less than the height {height:g}")
    if not 0 < taper <= 1:
        defects.append(f"finger.taper = {taper!r}: allowed: 0 < taper <= 1")
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
