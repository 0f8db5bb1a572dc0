# SPDX-License-Identifier: Apache-2.0
"""Anderson acceleration: exact on linear maps, and restarted where it does not help."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.terms.multiplier import Anderson


def iterate(matrix: NDArray[np.float64], fixed: NDArray[np.float64], count: int) -> list[float]:
    """Return the distance to the fixed point after each iteration of x -> fixed + M (x - fixed)."""
    anderson, x, distances = Anderson(), np.zeros_like(fixed), []
    for _ in range(count):
        x = anderson.next(x, (matrix - np.eye(len(fixed))) @ (x - fixed))
        distances.append(float(np.linalg.norm(x - fixed)))
    return distances


def test_first_step_is_plain() -> None:
    """Without a history the proposal is x + f."""
    x, f = np.array([1.0, 2.0]), np.array([0.5, -0.5])
    np.testing.assert_array_equal(Anderson().next(x, f), x + f)


def test_linear_maps_are_solved_in_as_many_steps_as_unknowns() -> None:
    """A slow linear contraction of 5 unknowns reaches its fixed point after 6 steps; plain iteration is far from it."""
    random = np.random.default_rng(0)
    basis, _ = np.linalg.qr(random.normal(size=(5, 5)))
    matrix, fixed = basis @ np.diag([0.99, 0.95, 0.9, 0.5, 0.1]) @ basis.T, random.normal(size=5)
    assert iterate(matrix, fixed, 7)[-1] < 1e-8
    assert np.linalg.norm(np.linalg.matrix_power(matrix, 7) @ fixed) > 0.1


def test_long_histories_forget_the_oldest() -> None:
    """With 40 unknowns, more than the history holds, the iteration is still far faster than the plain one."""
    matrix, fixed = np.diag(np.linspace(0.0, 0.98, 40)), np.ones(40)
    assert iterate(matrix, fixed, 60)[-1] < 1e-3 * 0.98**60


def test_growing_residual_restarts_with_a_plain_step() -> None:
    """After a residual that jumps, the next step is x + f, as without a history."""
    anderson = Anderson()
    for k in range(3):
        anderson.next(np.full(4, float(k)), np.full(4, 1.0 / (k + 1)))
    x, f = np.arange(4.0), np.array([10.0, -10.0, 10.0, 0.0])
    np.testing.assert_array_equal(anderson.next(x, f), x + f)


def test_repeated_residuals_do_not_blow_up() -> None:
    """Repeating the same position and residual keeps the proposal finite."""
    anderson = Anderson()
    for _ in range(10):
        proposal = anderson.next(np.ones(3), np.full(3, 1e-3))
    assert np.isfinite(proposal).all()


def test_inputs_are_left_alone() -> None:
    """Overwriting the arrays after the call does not change the history."""
    reused, fresh = Anderson(), Anderson()
    x, f = np.zeros(2), np.zeros(2)
    for values, residual in (([0.0, 0.0], [1.0, 1.0]), ([1.0, 1.0], [0.5, 0.4]), ([1.5, 1.4], [0.2, 0.2])):
        x[:], f[:] = values, residual
        found = reused.next(x, f)
        expected = fresh.next(np.array(values), np.array(residual))
    np.testing.assert_array_equal(found, expected)
