# SPDX-License-Identifier: Apache-2.0
"""The two-loop recursion equals the dense BFGS formula."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gdfe_ros.solver.descent import pairs
from gdfe_ros.solver.descent.workspace import Workspace, allocate

ROWS, MEMORY = 5, 4
# Only kernels may call the functions of the package.
remember = njit(lambda work: pairs.remember(work))
begin_recursion = njit(lambda work: pairs.begin_recursion(work))
end_recursion = njit(lambda work, z: pairs.end_recursion(work, z))


def workspace() -> Workspace:
    """Return a workspace for fifteen unknowns and four pairs."""
    return allocate(ROWS, np.zeros((ROWS, 3)), (1, 8), memory=MEMORY)


def stiffness() -> NDArray[np.float64]:
    """Return a positive definite matrix (15, 15)."""
    root = np.random.default_rng(0).standard_normal((3 * ROWS, 3 * ROWS))
    return root @ root.T + np.eye(3 * ROWS)


def give(work: Workspace, s: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    """Pass a step and the change of the gradient to the history; return whether it is remembered."""
    work.direction[...], work.old[...], work.gradient[...] = s, 0.0, y
    return remember(work)


def test_the_recursion_is_the_bfgs_formula() -> None:
    """With six pairs given, the product is that of BFGS with the last four around the initial matrix."""
    work, matrix, random = workspace(), stiffness(), np.random.default_rng(1)
    steps = random.standard_normal((6, 3 * ROWS))
    assert all(give(work, s, matrix @ s) for s in steps)
    initial = np.diag(random.uniform(0.5, 2.0, 3 * ROWS))
    inverse = initial
    for s in steps[-MEMORY:]:
        y, one = matrix @ s, np.eye(3 * ROWS)
        left = one - np.outer(s, y) / (s @ y)
        inverse = left @ inverse @ left.T + np.outer(s, s) / (s @ y)
    gradient = random.standard_normal(3 * ROWS)
    work.gradient[...] = gradient
    begin_recursion(work)
    z = initial @ work.step
    end_recursion(work, z)
    np.testing.assert_allclose(z, inverse @ gradient, rtol=1e-10)


def test_negative_curvature_is_not_remembered() -> None:
    """A pair whose curvature is not positive leaves the history as it is, also if the history is full."""
    work, matrix = workspace(), stiffness()
    for s in np.eye(3 * ROWS)[:6]:
        give(work, s, matrix @ s)
    kept = work.steps.copy(), work.changes.copy(), int(work.status[0].head)
    assert not give(work, np.ones(3 * ROWS), -matrix @ np.ones(3 * ROWS))
    np.testing.assert_array_equal(work.steps, kept[0])
    np.testing.assert_array_equal(work.changes, kept[1])
    assert int(work.status[0].head) == kept[2]
