# SPDX-License-Identifier: Apache-2.0
"""The search for balance finds the zero of a monotone gap with few evaluations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gdfe_ros.coupling.balance import BalanceSearch

Vector = np.ndarray


def evaluations(gap: Callable[[Vector], Vector], known: Vector, start: Vector, near: float) -> int:
    """Return the number of evaluations until the bound of the distance is at most ``near``."""
    search, q = BalanceSearch(known), start
    for count in range(1, 60):
        rest = gap(q)
        if np.abs(search.bound(rest)).max() <= near:
            return count
        q = search.next(q, rest)
    raise AssertionError("not found in 60 evaluations")


def test_a_linear_gap_takes_as_many_evaluations_as_unknowns() -> None:
    """For a linear gap of three unknowns, BFGS needs at most ten evaluations to 1e-9."""
    rng = np.random.default_rng(1)
    known = np.diag([1e4, 1e4, 2e3])
    root = rng.standard_normal((3, 3))
    whole = known + 3e3 * root @ root.T
    zero = np.array([0.1, -0.2, 0.3])
    assert evaluations(lambda q: whole @ (q - zero), known, np.zeros(3), 1e-9) <= 10


@pytest.mark.parametrize("ratio", [3.0, 60.0, 3000.0])
@pytest.mark.parametrize("start", [-0.02, 0.02])
def test_a_contact_that_opens_does_not_end_the_search(ratio: float, start: float) -> None:
    """Across a contact that is up to 3000 times stiffer than the joint, the zero is found from both sides."""

    def gap(q: Vector) -> Vector:
        return 200.0 * (q - 1e-3) + 200.0 * ratio * np.minimum(q - 2e-3, 0.0)

    assert evaluations(gap, np.array([[200.0]]), np.array([start]), 1e-8) <= 40


def test_the_bound_is_never_shorter_than_the_distance() -> None:
    """If the body adds stiffness, the bound by the joints' own stiffness is at least the distance to the zero."""
    search = BalanceSearch(np.array([[200.0]]))
    assert abs(search.bound(np.array([-700.0 * 0.01]))[0]) >= 0.01
