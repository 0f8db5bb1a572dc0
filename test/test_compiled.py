# SPDX-License-Identifier: Apache-2.0
"""Compilation of the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros.compiled import inlined, internal, kernel, vector_kernel
from gdfe_ros.linked import linked


def _sum(values):
    total = 0.0
    for i in range(len(values)):
        total += values[i]
    return total


exact, piece = kernel(_sum), inlined(_sum)
uncached = linked(cache=False)


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


@uncached
def _made(count):
    return np.ones(count)


@uncached
def _with_rows(values):
    total = 0.0
    for row in values:
        total += row[1:][0]
    return total


@uncached
def _with_another(values):
    return _made(3)[0] + values[0, 0]


@uncached
def _with_sums(values):
    return (values + values)[0, 0]


@uncached
def _with_chosen(values):
    return values[np.array([1, 0])][0, 0]


@uncached
def _with_parts(values):
    values[:1] = values[1:2]
    return values[0, 0]


@uncached
def _with_view(values):
    return values[0]


@pytest.mark.parametrize(
    ("function", "counts", "wanted"),
    [
        (_with_rows, False, 9.0),
        (_with_another, True, 1.0),
        (_with_sums, True, 0.0),
        (_with_chosen, True, 2.0),
        (_with_parts, True, 2.0),
        (_with_view, True, [0.0, 1.0]),
    ],
)
def test_references_are_counted_where_arrays_are_made(function: Any, counts: bool, wanted: Any) -> None:
    """Only a kernel that makes or returns an array counts references."""
    np.testing.assert_array_equal(function(np.arange(6.0).reshape(3, 2)), wanted)
    assert next(iter(function.overloads.values())).target_context.enable_nrt == counts


def test_a_kernel_without_an_entry_for_python_says_so() -> None:
    """A call from Python raises an error; it ended the process."""
    with pytest.raises(TypeError, match="advance_one has no entry for Python; only other kernels may call it"):
        advance_one(np.zeros(3))


@internal
def advance_one(x):
    """Add one to ``x``."""
    x += 1.0
