# SPDX-License-Identifier: Apache-2.0
"""LU factors that one thread makes and another drops: they are right, and their memory is freed."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import splu

from gdfe_ros.sparse_lu import LuFactor

SIZE = 900


def _matrix() -> sparse.csc_matrix:
    """Return a matrix whose factor has some MB."""
    random = sparse.random(SIZE, SIZE, 0.004, format="csc", random_state=1)
    return (random + random.T + 50.0 * sparse.eye(SIZE)).tocsc()


def _memory() -> float:
    """Return the resident memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * 4096 / 1e6


def test_a_factor_is_that_of_scipy() -> None:
    """The solution has the bits of scipy's, for one and for three right-hand sides."""
    matrix = _matrix()
    for right in (np.linspace(0.0, 1.0, SIZE), np.linspace(0.0, 1.0, 3 * SIZE).reshape(SIZE, 3)):
        assert np.array_equal(LuFactor(matrix).solve(right), splu(matrix).solve(right))
    with pytest.raises(RuntimeError, match="singular"):
        LuFactor(sparse.csc_matrix((3, 3)))


def test_a_factor_that_another_thread_drops_leaves_nothing() -> None:
    """Twenty factors that other threads made leave no memory after this thread has dropped them.

    scipy frees a factor only in the thread that made it: a node that builds in one thread and drops in another lost
    2.5 MB for each body spawned in `grasp`.
    """
    matrix, found = _matrix(), []
    for number in range(20):
        with ThreadPoolExecutor(1) as pool:
            factor = pool.submit(LuFactor, matrix).result()
        assert np.isfinite(factor.solve(np.ones(SIZE))).all()
        del factor
        found += [_memory()] if number >= 4 else []
    assert max(found) - found[0] < 20.0, found
