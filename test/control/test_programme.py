# SPDX-License-Identifier: Apache-2.0
"""The quadratic programme for one change of the commands, against its optimality conditions."""

from __future__ import annotations

import numpy as np

from gdfe_ros.control.limits import least_squares


def test_a_solution_is_at_a_bound_to_the_last_bit_or_has_no_slope() -> None:
    """In a solution, each component has zero gradient or is exactly at its bound."""
    random, leaning = np.random.default_rng(0), 0
    for _ in range(400):
        count = int(random.integers(1, 5))
        rows = random.standard_normal((3, count)) * 10.0 ** random.uniform(-6.0, 3.0, count)
        goal, least = random.standard_normal(3), 1e-4
        reach = 10.0 ** random.uniform(-2.0, 1.0, (2, count)) / np.linalg.norm(rows, axis=0)
        found = least_squares(rows, goal, -reach[0], reach[1], least=least)
        lengths = np.linalg.norm(rows, axis=0)
        slope = (rows.T @ (rows @ found - goal)) / lengths + least**2 * lengths * found
        low, high = slope > 1e-9, slope < -1e-9
        assert np.array_equal(found[low], -reach[0][low])
        assert np.array_equal(found[high], reach[1][high])
        leaning += int((low | high).sum())
    assert leaning > 100
