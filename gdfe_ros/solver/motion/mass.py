# SPDX-License-Identifier: Apache-2.0
"""Mass matrix of a body, consistent with the displacements of its cells; the same for x, y and z."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from gdfe_ros.actuators.load import AttachedMass, gauss_points
from gdfe_ros.mesh.filling import Filling
from gdfe_ros.solver.body import Body


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
    matrix = _collected(len(rest), cells, blocks)
    for item in attached:
        weights = item.points.weights
        matrix += _collected(len(rest), item.points.corners, item.part * weights[:, :, None] * weights[:, None, :])
    return matrix


class FreeMass:
    """Mass matrix of the free vertices and the rigid bodies; factored on first use.

    Args:
        body: the discretised body.
        mass: (n, n) its mass matrix [kg].
    """

    def __init__(self, body: Body, mass: sparse.csr_matrix) -> None:
        rigid = [each.vertices for each in body.rigid_bodies]
        self._free, self._mass = np.concatenate([body.unknowns.free, *rigid]), mass
        self._factor: SuperLU | None = None

    def accelerated(self, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the acceleration (n, 3) [m/s^2] of these vertices by forces (n, 3) [N]; zero for other vertices."""
        if self._factor is None:
            self._factor = splu(self._mass[self._free][:, self._free].tocsc())
        acceleration = np.zeros_like(forces)
        acceleration[self._free] = self._factor.solve(forces[self._free])
        return acceleration


def _collected(count: int, corners: NDArray[np.int32], blocks: NDArray[np.float64]) -> sparse.csr_matrix:
    """Return the sum (n, n) of ``blocks`` (m, k, k) that couple the vertices ``corners`` (m, k)."""
    size = corners.shape[1]
    rows, columns = np.repeat(corners, size, axis=1).ravel(), np.tile(corners, (1, size)).ravel()
    return sparse.coo_matrix((blocks.ravel(), (rows, columns)), shape=(count, count)).tocsr()
