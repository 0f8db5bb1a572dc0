# SPDX-License-Identifier: Apache-2.0
"""Factors of the constant matrix compared with those of libraries: each is measured and reported by name."""

from __future__ import annotations

import numpy as np

from benchmarks import constant_factors


def test_every_kind_is_measured_and_told() -> None:
    """The table has times for our factor and SuperLU's, and a dash for a kind that was not measured."""
    small = constant_factors.measured((6, 2, 2))
    assert small["vertices"] == 54
    assert {"supernodes", "SuperLU"} <= set(small["solve"])
    assert all(seconds > 0.0 for seconds in small["solve"].values())
    large = {**small, "factor": {"supernodes": 1.0}, "solve": {"supernodes": 0.01}}
    lines = constant_factors.table([small, large]).splitlines()
    assert "SuperLU: solve [ms]" in lines[0]
    assert lines[-1].split("|")[6].strip() == "-"


def test_the_libraries_solve_the_same_matrix() -> None:
    """The measured SuperLU solves the same matrix with a residual of rounding size."""
    matrix, points = constant_factors.held_bar((6, 2, 2))
    right = np.random.default_rng(0).standard_normal((len(points), 3))
    found = np.empty_like(right)
    constant_factors._superlu(matrix, right, found)()
    np.testing.assert_allclose(matrix @ found, right, atol=1e-10)
