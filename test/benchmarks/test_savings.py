# SPDX-License-Identifier: Apache-2.0
"""The benchmark of skipped work: its counts, and equal results with and without it."""

from __future__ import annotations

import pytest

from benchmarks.brush import Brush
from benchmarks.savings import saving_table, small_savings
from gdfe_ros.mesh.quality import check_mesh


@pytest.mark.parametrize(("rows", "length"), [((4, 2), 20), ((20, 5), 40)])
def test_a_brush_is_a_sound_body(rows: tuple[int, int], length: int) -> None:
    """A small and a large brush each have one piece of cubes, and a handle of nine vertices at every tip."""
    brush = Brush(rows=rows, length=length)
    scene = brush.scene(brush.bristles)
    assert not check_mesh(scene.mesh).defects
    assert scene.mesh.n_cells == 4 * brush.bristles * length + brush.palm * (3 * rows[0] - 1) * (3 * rows[1] - 1)
    assert {len(handle.vertices) for handle in scene.handles[1:]} == {9}


def test_small_savings_change_nothing() -> None:
    """Each of three skips is counted, and changes the bar's states by less than the tolerance."""
    rows = small_savings()
    assert [row.left for row in rows] == [625, 1250, 1250]
    assert all(row.error < 1e-3 for row in rows)
    assert saving_table(rows).count("\n") == 4
