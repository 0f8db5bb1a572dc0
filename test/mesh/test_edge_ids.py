# SPDX-License-Identifier: Apache-2.0
"""Edges are numbered in the order of their ends."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.mesh.surface_edges import number_edges


@pytest.mark.parametrize("count", [0, 1, 500])
def test_edges_are_the_different_rows(count: int) -> None:
    """The result is that of numpy's search for different rows, also without rows and for int32."""
    ends = np.random.default_rng(1).integers(0, 40, (count, 2)).astype(np.int32)
    edges, which = number_edges(ends)
    expected, number = np.unique(ends, axis=0, return_inverse=True)
    np.testing.assert_array_equal(edges, expected)
    np.testing.assert_array_equal(which, number.reshape(-1))
