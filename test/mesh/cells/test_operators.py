# SPDX-License-Identifier: Apache-2.0
"""Shape operators of general hexahedra: exact averages, hourglass modes without linear fields, symmetries."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.mesh.cells.filling import CORNERS
from gdfe_ros.mesh.cells.operators import ShapeOperators, shape_operators

CELL = np.arange(8, dtype=np.int32)[None]
CUBE = 0.5 + 0.5 * CORNERS
SHEARED = CUBE @ np.array([[2.0, 0.3, 0.1], [0.0, 1.0, 0.4], [0.0, 0.0, 0.5]])


def distorted(seed: int = 0) -> NDArray[np.float64]:
    """Return a unit cube whose corners are displaced at random by up to 0.2."""
    return CUBE + np.random.default_rng(seed).uniform(-0.2, 0.2, (8, 3))


def operators(corners: NDArray[np.float64]) -> ShapeOperators:
    """Return the operators of one element with these corners."""
    return shape_operators(np.ascontiguousarray(corners), CELL)


def gauss_average(corners: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return the volume and the mean shape gradients (8, 3) by 4 x 4 x 4 points and differences of the shapes."""
    points, weights = np.polynomial.legendre.leggauss(4)
    volume, total = 0.0, np.zeros((8, 3))
    for index in np.ndindex(4, 4, 4):
        factors = 1.0 + CORNERS * points[list(index)]
        others = np.stack([factors[:, 1] * factors[:, 2], factors[:, 0] * factors[:, 2], factors[:, 0] * factors[:, 1]])
        local = 0.125 * CORNERS * others.T
        jacobian = corners.T @ local
        weight = np.prod(weights[list(index)]) * np.linalg.det(jacobian)
        volume += weight
        total += weight * local @ np.linalg.inv(jacobian)
    return volume, total / volume


@pytest.mark.parametrize("seed", range(5))
def test_averages_are_exact_on_distorted_elements(seed: int) -> None:
    """Volume and mean gradient equal those with twice as many integration points."""
    corners = distorted(seed)
    found = operators(corners)
    volume, gradient = gauss_average(corners)
    assert found.volume[0] == pytest.approx(volume, rel=1e-13)
    np.testing.assert_allclose(found.gradient[0], gradient, rtol=0.0, atol=1e-13)


BUMP = np.eye(8)[:, [6]] * [1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("corners", "parallel"),
    [(CUBE, True), (SHEARED, True), (1e-3 * SHEARED + 1.0, True), (distorted(), False), (CUBE + 1e-6 * BUMP, False)],
    ids=["cube", "sheared", "far-away", "distorted", "bumped"],
)
def test_parallelepipeds_are_recognised(corners: NDArray[np.float64], parallel: bool) -> None:
    """Parallelepipeds, for which the sign patterns are exact, are recognised; one with a bump of 1e-6 edges is not."""
    assert bool(operators(corners).parallel[0]) is parallel
