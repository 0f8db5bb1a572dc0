# SPDX-License-Identifier: Apache-2.0
"""The mass of a body: the matrix that belongs to trilinear displacements, the same for x, y and z."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.actuators.load import AttachedMass, gauss_points


def mass_matrix(
    rest: NDArray[np.float64],
    cells: NDArray[np.int32],
    density: NDArray[np.float64],
    attached: Sequence[AttachedMass] = (),
) -> sparse.csr_matrix:
    """Return M_ab = sum_e rho_e int N_a N_b dV (n, n) [kg], and attached masses on its diagonal.

    Lumped at vertices, a section two cells across would have 1.5 times its polar moment.

    Args:
        rest: (n, 3) rest vertices [m].
        cells: (m, 8) their corners.
        density: (m,) [kg/m^3].
        attached: masses on vertices.
    """
    blocks = np.zeros((len(cells), 8, 8))
    for volume, shape in gauss_points(rest, cells):
        blocks += (density * volume)[:, None, None] * np.outer(shape, shape)
    rows, columns = np.repeat(cells, 8, axis=1).ravel(), np.tile(cells, (1, 8)).ravel()
    matrix = sparse.coo_matrix((blocks.ravel(), (rows, columns)), shape=(len(rest), len(rest)))
    lumps = sum((item.spread(len(rest)) for item in attached), np.zeros(len(rest)))
    return (matrix + sparse.diags(lumps)).tocsr()
