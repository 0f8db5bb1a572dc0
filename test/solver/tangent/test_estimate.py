# SPDX-License-Identifier: Apache-2.0
"""The distance by conjugate gradients: exact for matrices that are known, honest where it is not found."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.solver.distance import largest
from gdfe_ros.solver.tangent.curvature import lowest
from gdfe_ros.solver.tangent.estimate import HIDDEN, estimate
from gdfe_ros.solver.tangent.smooth_field import smooth_field

COUNT = 60


def _matrix(eigenvalues: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a symmetric matrix with given eigenvalues."""
    vectors, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((COUNT, COUNT)))
    return vectors * eigenvalues @ vectors.T


def _identity(right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    out[...] = right


@pytest.mark.parametrize("least", [1.0, 1e-2, 1e-4])
def test_the_distance_is_that_of_the_newton_step(least: float) -> None:
    """Take matrices as soft as 1e-4 in a few motions: the distance is between the step's and twice that."""
    values = np.ones(COUNT)
    values[:3] = least * np.array([1.0, 1.5, 2.0])
    matrix, gradient = _matrix(values), np.random.default_rng(1).standard_normal(COUNT)
    found = estimate(lambda direction: matrix @ direction, gradient, gradient, _identity, 1e-12)
    true = largest(-np.linalg.solve(matrix, gradient))
    assert found.known
    assert found.definite
    assert 0.7 * true <= found.distance <= 2.0 * true


def test_negative_curvature_is_told() -> None:
    """Let one eigenvalue be negative, and the gradient lie along it: the energy falls ever faster that way."""
    values = np.linspace(1.0, 2.0, COUNT)
    values[0] = -0.5
    matrix = _matrix(values)
    gradient = np.linalg.eigh(matrix)[1][:, 0] + 0.1 * np.random.default_rng(1).standard_normal(COUNT)
    found = estimate(lambda direction: matrix @ direction, gradient, gradient, _identity, 1e-12)
    assert (found.known, found.definite, found.distance) == (False, False, np.inf)
    assert found.step @ matrix @ found.step < 0.0


def test_what_is_not_found_is_not_known() -> None:
    """Spread the eigenvalues over twelve decades: after the last product the distance is infinite."""
    matrix, gradient = _matrix(np.logspace(0, -12, COUNT)), np.random.default_rng(1).standard_normal(COUNT)
    found = estimate(lambda direction: matrix @ direction, gradient, gradient, _identity, 1e-12, most=20)
    assert (found.known, found.definite, found.distance, found.products) == (False, True, np.inf, 20)


def test_a_random_right_hand_side_finds_the_one_soft_motion() -> None:
    """Let one motion be 1e-4 as stiff as the others: it is found."""
    values = np.linspace(0.04, 1.0, COUNT)
    values[0] = 1e-6
    matrix, random = _matrix(values), np.random.default_rng(3)
    for _ in range(20):
        probe = random.standard_normal(COUNT)
        found = estimate(lambda direction: matrix @ direction, probe, probe, _identity, 0.0, left_over=HIDDEN / COUNT)
        assert found.least == pytest.approx(1e-6, rel=0.1)


def test_softness_is_the_least_eigenvalue() -> None:
    """Let Lanczos steps find the least eigenvalue of a known matrix, from a start that has all."""
    matrix = _matrix(np.logspace(-3, 0, COUNT))
    start = np.random.default_rng(2).standard_normal(COUNT)
    found = lowest(lambda direction: matrix @ direction, _identity, start, most=59, steady=0.0)
    assert found.value == pytest.approx(1e-3, rel=0.05)


def test_the_start_holds_every_low_motion() -> None:
    """A smooth field is a polynomial of the third degree, and the same in every run."""
    points, one = np.random.default_rng(0).standard_normal((200, 3)), np.zeros(200, np.int32)
    np.testing.assert_array_equal(smooth_field(points, one), smooth_field(points, one))
    x = points[:, 0]
    assert np.linalg.matrix_rank(np.stack([smooth_field(points, one)[:, 0], np.ones(200), x, x**2, x**3], axis=1)) == 5


def test_each_piece_has_a_field_of_its_own() -> None:
    """Put a body a thousand sizes beside another: the field of each is that which it has alone."""
    points, one = np.random.default_rng(0).standard_normal((200, 3)), np.zeros(200, np.int32)
    alone, both = smooth_field(points, one), np.concatenate([points, points + 1000.0])
    found = smooth_field(both, np.repeat(np.arange(2, dtype=np.int32), 200))
    np.testing.assert_allclose(found, np.concatenate([alone, alone]), atol=1e-9)
