# SPDX-License-Identifier: Apache-2.0
"""The lowest eigenvalue of known matrices and its direction."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.solver.minimise.curvature import Lanczos

COUNT = 60


def _symmetric(eigenvalues: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    vectors, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((COUNT, COUNT)))
    return vectors * eigenvalues @ vectors.T, vectors


@pytest.mark.parametrize("least", [-1.0, -1e-3, 0.0, 1e-3, 0.5])
def test_the_least_eigenvalue_and_its_vector_are_found(least: float) -> None:
    """One eigenvalue below many is found with its sign, value and eigenvector, in the preconditioner's norm."""
    weight, _ = _symmetric(np.linspace(1.0, 4.0, COUNT))
    root = np.linalg.cholesky(weight)
    values = np.linspace(0.6, 1.0, COUNT)
    values[7] = least
    inner, vectors = _symmetric(values)
    matrix, load = root @ inner @ root.T, np.random.default_rng(1).standard_normal(COUNT)

    def precondition(right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        out[...] = np.linalg.solve(weight, right)

    found = Lanczos().lowest(lambda direction: matrix @ direction, precondition, load)
    assert found.known
    assert found.value == pytest.approx(least, abs=1e-3 if least else 1e-4)
    true = np.linalg.solve(root.T, vectors[:, 7])
    assert abs(found.direction @ weight @ true) == pytest.approx(1.0, abs=0.05 if least == 0.5 else 1e-2)
