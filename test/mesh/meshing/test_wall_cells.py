# SPDX-License-Identifier: Apache-2.0
"""Walls of a mesh that are much thinner than its cells are long."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.mesh import bar
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.meshing.walls import flat_walls, wall_cells
from gdfe_ros.mesh.tetmesh import divide


def test_a_plate_of_one_layer_is_as_flat_as_its_cells() -> None:
    """The cells of a plate have edges of the bricks' diagonals, divided by the thickness of the plate."""
    walls, edges = wall_cells(divide(bar([0.1, 0.1, 0.002], [10, 10, 1])))
    thin = np.isclose(walls.thickness, 0.002)
    assert walls.fraction(thin) == pytest.approx(0.02 / 0.0208)
    np.testing.assert_allclose((edges / walls.thickness)[thin], 2**0.5 * 5.0)


@pytest.mark.parametrize(("cells", "told"), [(10, True), (20, False)])
def test_only_flat_cells_are_remarked(cells: int, told: bool) -> None:
    """A plate with edges of 7 times its thickness is remarked with place and remedy; 3.5 times is not."""
    texts = flat_walls(divide(bar([0.1, 0.1, 0.002], [cells, cells, 1])))
    assert bool(texts) is told
    for text in texts:
        assert "the worst 0.002 m thick near (" in text
        assert "remedy: a smaller `size`, or `least_size: 0.002`" in text


def test_a_thin_wall_of_a_chamber_is_found() -> None:
    """The roof of a chamber, 1 mm under a block of 10 mm, is the worst wall; other walls are thick."""
    block = bar([0.05, 0.05, 0.012], [5, 5, 12])
    middle = np.abs(block.centroids - (0.025, 0.0, 0.0)) < (0.02, 0.02, 0.005)
    hollow = divide(keep_cells(block, ~middle.all(axis=1)))
    walls, edges = wall_cells(hollow)
    worst = np.argmax(edges / walls.thickness)
    assert walls.thickness[worst] == pytest.approx(0.001)
    assert abs(walls.places[worst, 2]) > 0.0049
    assert len(flat_walls(hollow)) == 1
