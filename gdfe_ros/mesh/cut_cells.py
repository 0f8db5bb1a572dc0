# SPDX-License-Identifier: Apache-2.0
"""Volume, centroid and second moments of the material inside a closed surface, for each cube of a grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Number of columns through a cube along an axis, and the generator of their Fibonacci lattice. No two columns have a
#: coordinate in common. If a wall perpendicular to one of the other two axes moves through the cube, it thus passes the
#: columns one by one. Along a column the integrals are exact.
COLUMNS, LATTICE = 144, 89
#: Filled fraction below which a cube does not become a cell: its material moves to the fullest neighbouring cell.
LEAST_SHARE = 0.1
#: Difference of the filled fraction from 0 or 1 below which a cube counts as empty or whole.
EXACT = 1e-9


def cube_moments(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], count: tuple[int, int, int]
) -> NDArray[np.float64]:
    """Return the moments of the material inside a closed surface, for each cube of a grid.

    Args:
        vertices: positions in units of the cubes' edge, from the grid's first corner, shape (n, 3).
        triangles: vertex ids of a closed surface, shape (t, 3).
        count: number of cubes along each axis.

    Returns:
        Moments (cubes, 7), x fastest: integrals of 1, xi, eta, zeta, xi^2, eta^2, zeta^2 over the material, divided by
        the volume of the whole cube. The reference coordinates xi, eta, zeta are -1 .. 1 in the cube.
    """
    directions = [_along(vertices, triangles, count, axis) for axis in range(3)]
    moments, crossed = (np.stack(part) for part in zip(*directions, strict=True))
    moments = np.take_along_axis(moments, crossed.argmax(axis=0)[None, :, None], axis=0)[0]
    whole = np.abs(moments[:, 0] - 1.0) < EXACT
    moments[whole] = [1.0, 0.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0]
    moments[moments[:, 0] < EXACT] = 0.0
    return moments


def _along(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], count: tuple[int, int, int], axis: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Integrate along columns parallel to an axis; return moments (cubes, 7) and the number of crossings in each cube.

    A crossing is an intersection of a column with the surface. Columns resolve the surface exactly along their axis.
    The axis with most crossings is closest to the surface's normal.
    """
    from gdfe_ros.mesh.cell_kernels import integrate_columns  # scenes without cut cells load without numba

    turn = [(axis + 1) % 3, (axis + 2) % 3, axis]
    size = tuple(count[i] for i in turn)
    moments = np.zeros((8, np.prod(size)))
    number = np.arange(COLUMNS)
    places = np.column_stack([number + 0.5, number * LATTICE % COLUMNS + 0.5]) / COLUMNS
    integrate_columns(np.ascontiguousarray(vertices[:, turn]), triangles.astype(np.int64), places, size, moments)
    back = [turn.index(i) for i in range(3)]
    rows = [0, *(1 + i for i in back), *(4 + i for i in back), 7]
    grid = moments[rows].reshape(8, *size[::-1]).transpose(0, *(3 - back[i] for i in (2, 1, 0)))
    grid = grid.reshape(8, -1).T
    return grid[:, :7] / COLUMNS, grid[:, 7]


def gather_slivers(moments: NDArray[np.float64], count: tuple[int, int, int]) -> NDArray[np.float64]:
    """Move the material of slivers (nearly empty cubes) to neighbouring cells; return the new moments (cubes, 7).

    The receiving cell is the fullest cell that shares a face with the sliver. If slivers were cells, some of their
    corners would have a millionth of a cell's stiffness. If their material were dropped, the error would be of first
    order. The moved material follows the extrapolated displacement field of the receiving cell. A sliver without a
    neighbouring cell is dropped.
    """
    nx, ny, nz = count
    gathered = moments.copy()
    share = moments[:, 0].reshape(nz, ny, nx)
    slivers = np.argwhere((share > 0.0) & (share < LEAST_SHARE))
    best, owner, away = np.zeros(len(slivers)), np.full(len(slivers), -1), np.zeros((len(slivers), 3))
    for axis in range(3):
        for side in (-1, 1):
            beside = slivers.copy()
            beside[:, axis] += side
            there = (beside[:, axis] >= 0) & (beside[:, axis] < share.shape[axis])
            beside[~there] = 0
            full = np.where(there, share[tuple(beside.T)], 0.0)
            better = (full >= LEAST_SHARE) & (full > best)
            best[better] = full[better]
            owner[better] = np.ravel_multi_index(tuple(beside[better].T), share.shape)
            away[better] = 0.0
            away[better, 2 - axis] = -2.0 * side
    sliver, taken = np.ravel_multi_index(tuple(slivers.T), share.shape), owner >= 0
    own = moments[sliver]
    first = own[:, 1:4] + away * own[:, :1]
    second = own[:, 4:] + 2.0 * away * own[:, 1:4] + away**2 * own[:, :1]
    np.add.at(gathered, owner[taken], np.column_stack([own[:, 0], first, second])[taken])
    gathered[sliver] = 0.0
    return gathered
