# SPDX-License-Identifier: Apache-2.0
"""A cylinder cut from voxels bends as a cylinder, along the grid and across it."""

from __future__ import annotations

import pytest

from benchmarks.cut_cells import bending_stiffness


@pytest.mark.parametrize("direction", [0.0, 30.0])
def test_cut_cells_bend_as_the_cylinder_that_they_are_cut_from(direction: float) -> None:
    """A cylinder of 6 cut cells per diameter bends with E I within 3 %; whole cubes have more than twice its error."""
    cut, whole = (bending_stiffness(6, kind, direction) for kind in ("cut", "whole"))
    assert cut["converged"]
    assert cut["stiffness"] == pytest.approx(1.0, abs=0.03)
    assert abs(whole["stiffness"] - 1.0) > 2.0 * abs(cut["stiffness"] - 1.0)
