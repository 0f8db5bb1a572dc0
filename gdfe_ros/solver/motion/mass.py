# SPDX-License-Identifier: Apache-2.0
"""Mass matrix of a body, consistent with the displacements of its cells; the same for x, y and z."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.actuators.load import AttachedMass, gauss_points
from gdfe_ros.mesh.filling import Filling
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import scattered
from gdfe_ros.sparse_lu import LuFactor


def mass_matrix(
    rest: NDArray[np.float64],
    cells: NDArray[np.int32],
    density: NDArray[np.float64],
    attached: Sequence[AttachedMass] = (),
    *,
    filling: Filling | None = None,
) -> sparse.csr_matrix:
    """Return the mass matrix M_ab = sum_e rho_e int N_a N_b dV (n, n) [kg], plus m N_a N_b of each attached mass m.

    With a lumped matrix, the polar moment of a section two cells across would be 1.5 times too large.

    Args:
        rest: (n, 3) rest vertices [m].
        cells: (m, c) vertices of the cells.
        density: (m,) densities of the cells [kg/m^3].
        attached: masses on material points.
        filling: filled fraction of cut cells.
    """
    blocks = np.zeros((len(cells), cells.shape[1], cells.shape[1]))
    for volume, shape in gauss_points(rest, cells, filling):
        blocks += (density * volume)[:, None, None] * (shape[:, :, None] * shape[:, None, :])
    matrix = scattered(blocks, cells, len(rest)).tocsr()
    for item in attached:
        weights = item.points.weights
        blocks = item.part * weights[:, :, None] * weights[:, None, :]
        matrix += scattered(blocks, item.points.corners, len(rest)).tocsr()
    return matrix


class FreeMass:
    """Mass matrix of the free vertices and the rigid bodies; factored on first use.

    Args:
        body: the discretised body.
        mass: (n, n) its mass matrix [kg].
    """

    def __init__(self, body: Body, mass: sparse.csr_matrix) -> None:
        rigid = [each.vertices for each in body.rigid_bodies]
        free, self._mass = np.concatenate([body.unknowns.free, *rigid]), mass
        moves = np.ones((len(free), 3), dtype=bool)
        moves.reshape(-1)[body.unknowns.fixed] = False
        self._free = [free[along] for along in moves.T]
        self._factors: list[LuFactor] = []

    def accelerated(self, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the acceleration (n, 3) [m/s^2] of these vertices by forces (n, 3) [N]; zero for other vertices."""
        if not self._factors:
            alike = all(len(free) == len(self._free[0]) for free in self._free)  # no rollers, or alike in x, y and z
            axes = self._free[:1] if alike and all(map(np.array_equal, self._free, self._free[1:])) else self._free
            self._factors = [LuFactor(self._mass[free][:, free].tocsc()) for free in axes]
        acceleration = np.zeros_like(forces)
        for axis, free in enumerate(self._free):
            acceleration[free, axis] = self._factors[axis % len(self._factors)].solve(forces[free, axis])
        return acceleration
