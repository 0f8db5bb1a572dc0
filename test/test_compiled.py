# SPDX-License-Identifier: Apache-2.0
"""Compilation of the kernels."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.compiled import inlined, internal, kernel, vector_kernel


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


def test_a_kernel_without_an_entry_for_python_says_so() -> None:
    """A call from Python raises an error; it ended the process."""
    with pytest.raises(TypeError, match="advance_one has no entry for Python; only other kernels may call it"):
        advance_one(np.zeros(3))


@internal
def advance_one(x):
    """Add one to ``x``."""
    x += 1.0
