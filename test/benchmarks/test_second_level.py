# SPDX-License-Identifier: Apache-2.0
"""The comparison with and without the stored tangent, on its smallest stream."""

from __future__ import annotations

from benchmarks.second_level import HEADINGS, TOLERANCE, row, table
from benchmarks.torture.honesty import STREAMS


def test_a_truss_needs_far_fewer_iterations_with_the_kept_tangent() -> None:
    """With the stored tangent, the truss takes a tenth of the iterations, for an error within the tolerance."""
    found = dict(
        zip(
            [*HEADINGS[:4], "tolerance", "error", "iterations", "ms", "ratio"],
            row("truss", STREAMS["truss"]),
            strict=True,
        )
    )
    assert float(found[HEADINGS[1]]) <= TOLERANCE
    assert float(found["error"]) <= float(found[HEADINGS[1]])
    assert 10.0 * float(found[HEADINGS[2]]) < float(found["iterations"])
    assert table([row_ := list(found.values())]).splitlines()[2] == f"| {' | '.join(row_)} |"
