# SPDX-License-Identifier: Apache-2.0
"""Compilation of the kernels."""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import inlined, kernel, vector_kernel


def _sum(values):
    total = 0.0
    for i in range(len(values)):
        total += values[i]
    return total


exact, piece = kernel(_sum), inlined(_sum)


@vector_kernel
def _both(values):
    return exact(values), piece(values)


def test_a_kernel_rounds_the_same_whoever_has_it_compiled() -> None:
    """A sum in a kernel of its own, or inlined, keeps its order inside a kernel that may reorder sums."""
    values = np.random.default_rng(1).normal(size=1000)
    in_order = 0.0
    for value in values:
        in_order += float(value)
    assert _both(values) == (in_order, in_order)
    assert exact(values) == in_order
