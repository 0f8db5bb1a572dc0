# SPDX-License-Identifier: Apache-2.0
"""Structured hexahedral grids of a bar, and evaluation of a solution at any point of the bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ids = npt.NDArray[np.int32]

_CORNERS = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]

HEXAHEDRON8 = np.array(_CORNERS, dtype=np.float64)
"""Reference coordinates of the 8 nodes of a linear hexahedron, VTK order, in [-1, 1]."""
HEXAHEDRON20 = np.vstack([HEXAHEDRON8, [(HEXAHEDRON8[a] + HEXAHEDRON8[b]) / 2 for a, b in _EDGES]])
"""Reference coordinates of the 20 nodes of a serendipity hexahedron, VTK order, in [-1, 1]."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """A bar of equal boxes with a lattice of nodes; x from 0, y and z centred on 0.

    Node ``(i, j, k)`` has index ``i + (nx + 1) * (j + (ny + 1) * k)`` with ``n = order * cells``
    lattice steps along each axis; cells are counted likewise.

    Attributes:
        size: lengths along x, y, z [m].
        cells: number of hexahedra along x, y, z.
        order: 1 for linear hexahedra, 2 for quadratic ones (with mid-side, mid-face and centre nodes).
    """

    size: tuple[float, float, float]
    cells: tuple[int, int, int]
    order: int = 1

    @property
    def steps(self) -> tuple[int, int, int]:
        """Number of lattice steps along x, y, z."""
        nx, ny, nz = (self.order * count for count in self.cells)
        return nx, ny, nz

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return int(np.prod(self.cells))

    @property
    def label(self) -> str:
        """Numbers of cells as text, such as ``50x5x5``."""
        return "x".join(str(count) for count in self.cells)

    def points(self) -> Array:
        """Return the undeformed positions of the lattice nodes, shape (n, 3), float64 [m]."""
        lo = (0.0, -self.size[1] / 2, -self.size[2] / 2)
        axes = [
            low + length * np.arange(count + 1) / count
            for low, length, count in zip(lo, self.size, self.steps, strict=True)
        ]
        z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
        return np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)

    def connectivity(self, nodes: Array = HEXAHEDRON8) -> Ids:
        """Return the lattice indices of every cell's nodes.

        Args:
            nodes: reference coordinates in [-1, 1] of the element's nodes in its own order, shape
                (a, 3): `HEXAHEDRON8`, `HEXAHEDRON20` or those of another library's element.

        Returns:
            Indices, shape (m, a), int32.
        """
        nx, ny, nz = self.cells
        k, j, i = np.meshgrid(np.arange(nz), np.arange(ny), np.arange(nx), indexing="ij")
        origin = np.stack([i.ravel(), j.ravel(), k.ravel()], axis=1) * self.order
        offset = np.rint((np.asarray(nodes) + 1.0) / 2.0 * self.order).astype(np.int64)
        return self._index(origin[:, None, :] + offset[None, :, :]).astype(np.int32)

    def face(self, *, right: bool) -> Ids:
        """Return the sorted lattice indices of the left or the right face, shape (f,), int32."""
        nx, ny, nz = self.steps
        return ((nx if right else 0) + (nx + 1) * np.arange((ny + 1) * (nz + 1))).astype(np.int32)

    def evaluate(self, values: Array, points: Array) -> Array:
        """Interpolate nodal values at points of the bar with the element's shape functions.

        Trilinear for order 1, triquadratic Lagrange for order 2.

        Args:
            values: nodal values, shape (n, c), float64.
            points: rest positions, shape (k, 3), float64 [m].

        Returns:
            Interpolated values, shape (k, c), float64.

        Raises:
            ValueError: a point is outside the bar.
        """
        size, cells = np.asarray(self.size), np.asarray(self.cells)
        unit = (points - [0.0, -self.size[1] / 2, -self.size[2] / 2]) / size
        outside = np.nonzero(np.any((unit < -1e-9) | (unit > 1 + 1e-9), axis=1))[0]
        if outside.size:
            raise ValueError(f"grid {self.label}: points {outside[:10].tolist()} lie outside the bar")
        cell = np.clip(np.floor(unit * cells).astype(np.int64), 0, cells - 1)
        weights = lagrange_weights(unit * cells - cell, order=self.order)
        result = np.zeros((len(points), values.shape[1]))
        for offset in np.ndindex(*(3 * [self.order + 1])):
            weight = weights[:, 0, offset[0]] * weights[:, 1, offset[1]] * weights[:, 2, offset[2]]
            result += weight[:, None] * values[self._index(cell * self.order + offset)]
        return result

    def complete_serendipity(self, values: Array) -> Array:
        """Compute the values of face-centre and body-centre nodes from those of 20-node serendipity hexahedra.

        The serendipity polynomials are a subset of the triquadratic ones. Therefore `evaluate` of the
        completed lattice is exactly the interpolation of the 20-node element.

        Args:
            values: nodal values, shape (n, c); only the values at the 20 nodes of each cell are used.

        Returns:
            A completed copy, shape (n, c), float64.
        """
        filled = values.copy()
        nodal = values[self.connectivity(HEXAHEDRON20)]
        for target in np.ndindex(3, 3, 3):
            local = np.array(target, dtype=np.float64) - 1.0
            if np.count_nonzero(local == 0.0) < 2:
                continue
            ids = self.connectivity(local[None, :])[:, 0]
            filled[ids] = np.einsum("a,mac->mc", serendipity_weights(local), nodal)
        return filled

    def _index(self, lattice: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        nx, ny, _ = self.steps
        return lattice[..., 0] + (nx + 1) * (lattice[..., 1] + (ny + 1) * lattice[..., 2])


def lagrange_weights(position: Array, *, order: int) -> Array:
    """Return the Lagrange weights of equidistant nodes on [0, 1].

    Args:
        position: coordinates, any shape, float64.
        order: 1 or 2.

    Returns:
        Weights, shape ``position.shape + (order + 1,)``, float64.
    """
    t = np.asarray(position, dtype=np.float64)
    if order == 1:
        return np.stack([1.0 - t, t], axis=-1)
    return np.stack([(2.0 * t - 1.0) * (t - 1.0), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0)], axis=-1)


def serendipity_weights(local: Array) -> Array:
    """Return the 20 serendipity shape functions at one point in [-1, 1]^3, shape (20,), float64.

    Corner: ``1/8 prod(1 + x x_a) (sum x x_a - 2)``; mid-edge: ``1/4 (1 - x^2) (1 + y y_a)(1 + z z_a)``
    (Zienkiewicz, Taylor and Zhu, The Finite Element Method, ch. 6).
    """
    product = local[None, :] * HEXAHEDRON20
    corner = np.prod(1.0 + product[:8], axis=1) * (product[:8].sum(axis=1) - 2.0) / 8.0
    bubble = np.where(HEXAHEDRON20[8:] == 0.0, 1.0 - local[None, :] ** 2, 1.0 + product[8:])
    return np.concatenate([corner, np.prod(bubble, axis=1) / 4.0])
