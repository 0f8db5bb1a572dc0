# SPDX-License-Identifier: Apache-2.0
"""Choice of a body's Cholesky factor: by supernodes, or banded if that is large and little more work."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.solver.matrix.elimination import Elimination, eliminated
from gdfe_ros.solver.matrix.ordering import least_degree, narrow_order, spread
from gdfe_ros.solver.tangent.band import Band
from gdfe_ros.solver.tangent.fronts import Fronts

PACE = 1.7
"""Multiplications of LAPACK's banded factorisation in the time of one in a front, on a processor with AVX-512."""
FEW = 50_000_000
"""Multiplications of a banded factorisation up to which fronts are used anyway: a minimisation with fronts is compiled
as a whole, which saves more than LAPACK's speed."""


class Factor(Protocol):
    """Factors matrices of one pattern in succession, and solves with the last factor.

    Attributes:
        price: cost of a factorisation, in solutions.
    """

    price: int

    def factor(self, blocks: NDArray[np.float64]) -> bool:
        """Factor a matrix of blocks (k, 3, 3); return whether it is positive definite. If not, there is no factor."""

    def solve(self, right: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the solution for right-hand sides (3 f,) or (3 f, k)."""


def factor_for(graph: sparse.csr_matrix, points: NDArray[np.float64]) -> Factor:
    """Return the fastest factor for the matrices of a body.

    Args:
        graph: (f, f) an entry for each block (3, 3) of the matrices, symmetric, in their order.
        points: (f, 3) vertices [m].
    """
    narrow = narrow_order(graph, points)
    found = least_filled(graph, narrow)
    banded = 3 * len(points) * (3 * spread(graph, narrow) + 3) ** 2
    return Band(graph, narrow) if FEW < banded <= PACE * 27 * found.work else Fronts(graph, found)


def least_filled(graph: sparse.csr_matrix, narrow: NDArray[np.int64]) -> Elimination:
    """Return the elimination with less work: in the ``narrow`` order (f,), or in that of minimum degree."""
    return min((eliminated(graph, order) for order in (narrow, least_degree(graph))), key=lambda each: each.work)
