# SPDX-License-Identifier: Apache-2.0
"""A quarter disc of quadratic quadrilaterals: the part x, y >= 0 of a ball's meridian section, finer near the pole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

GRADING = 1.5
"""Exponent of the grading: positions from 0 to 1 along an edge are raised to this power, so that cells are smaller near
the pole and the rim.
"""
_INNER = 0.5, 0.45
"""End of the central block on the axes, and coordinate of its corner on the diagonal."""
_ROUND = np.array([[0, 0], [2, 0], [2, 2], [0, 2], [1, 0], [2, 1], [1, 2], [0, 1]])
"""Lattice positions of the nodes of an eight-node quadrilateral: corners, then midpoints of the sides."""


@dataclass(frozen=True, eq=False)
class Disc:
    """A mesh of the quarter x, y >= 0 of the unit disc, with the pole at (0, 1).

    Attributes:
        points: positions of the nodes (n, 2).
        cells: nodes (m, 8): corners counter-clockwise, then the midpoints of the sides between them.
        rim: cell and side (from 0) of each side on the circle between the pole and 45 degrees.
    """

    points: npt.NDArray[np.float64]
    cells: npt.NDArray[np.int64]
    rim: list[tuple[int, int]]


def quarter_disc(cells: int) -> Disc:
    """Return the mesh with ``cells`` cells along an eighth of the circle."""
    even = np.linspace(0.0, 1.0, 2 * cells + 1)
    graded, outwards = even**GRADING, 1.0 - (1.0 - even) ** GRADING
    edge, corner = _INNER
    top = np.stack([graded * corner, edge + (corner - edge) * graded], axis=1)
    side = np.stack([edge + (corner - edge) * even, even * corner], axis=1)
    arcs = [np.stack([np.sin(a), np.cos(a)], axis=1) for a in (graded * np.pi / 4, np.pi / 2 - even * np.pi / 4)]
    above, beside = (
        (1.0 - outwards)[:, None] * inner[:, None] + outwards[:, None] * arc[:, None]
        for inner, arc in zip((top, side), arcs, strict=True)
    )
    u, v = graded[:, None, None], even[None, :, None]
    bottom, left = edge * u * [1.0, 0.0], edge * v * [0.0, 1.0]
    ends = u * (1.0 - v) * side[0] + (1.0 - u) * v * top[0] + u * v * top[-1]
    centre = (1.0 - v) * bottom + v * top[:, None] + (1.0 - u) * left + u * side[None] - ends
    lattice = np.concatenate([block.reshape(-1, 2) for block in (above, centre, beside)])
    _, firsts, numbers = np.unique(lattice.round(9), axis=0, return_index=True, return_inverse=True)
    points, found, rim = lattice[firsts], [], []
    grids = numbers.reshape(3, 2 * cells + 1, 2 * cells + 1)
    for grid in grids:
        for i, j in np.ndindex(cells, cells):
            nodes = grid[_ROUND[:, 0] + 2 * i, _ROUND[:, 1] + 2 * j]
            x, y = points[nodes[:4]].T
            if x @ np.roll(y, -1) < y @ np.roll(x, -1):
                nodes = nodes[[0, 3, 2, 1, 7, 6, 5, 4]]
            found.append(nodes)
    used, numbered = np.unique(np.array(found), return_inverse=True)
    numbered = numbered.reshape(-1, 8)
    on_rim = set(np.flatnonzero(np.isin(used, grids[0][:, -1])).tolist())
    for cell in range(cells**2):
        corners = numbered[cell, :4].tolist()
        rim += [(cell, i) for i in range(4) if {corners[i], corners[(i + 1) % 4]} <= on_rim]
    return Disc(points[used], numbered, rim)
