# SPDX-License-Identifier: Apache-2.0
"""Sizes of cells on a grid: twice the thickness at walls, growing with the distance, within their limits."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gdfe_ros.mesh.walls import EDGES_ALONG, GROWTH, LEVELS, SizeField, default_size, find_walls, wall_sizes

SIZE = 0.01


def field_of(thickness: float, least_size: float) -> SizeField:
    """Return the sizes for a block of 40 mm with a closed pocket that leaves a wall at its top."""
    block, pocket = trimesh.creation.box((0.04, 0.04, 0.04)), trimesh.creation.box((0.02, 0.02, 0.01))
    pocket.apply_translation((0.0, 0.0, 0.015 - thickness))
    pocket.invert()
    both = trimesh.util.concatenate([block, pocket])
    points = np.asarray(both.vertices)
    walls = find_walls(points, np.asarray(both.faces), spacing=least_size)
    return wall_sizes(walls, size=SIZE, least_size=least_size, bounds=both.bounds)


def size_at(field: SizeField, *place: float) -> float:
    """Return the size at the grid point next to a place."""
    return float(field.sizes[tuple(np.rint((np.array(place) - field.start) / field.spacing).astype(int))])


@pytest.mark.parametrize(("thickness", "wanted"), [(0.0015, 0.003), (0.0004, 0.001), (0.0049, 0.0098)])
def test_sizes_follow_the_wall(thickness: float, wanted: float) -> None:
    """At a wall the size is twice its thickness, rounded down to a level, within the least size and the size."""
    found = size_at(field_of(thickness, 0.001), 0.0, 0.0, 0.02)
    assert wanted * 2.0 ** (-1.0 / LEVELS) - 1e-12 <= found <= wanted + GROWTH * 0.001
    assert EDGES_ALONG * thickness >= wanted or wanted == 0.001


def test_sizes_grow_with_the_distance_and_end_at_the_size() -> None:
    """Sizes of neighbouring points differ by at most the growth; far from the wall is the full size."""
    field = field_of(0.001, 0.001)
    for axis in range(3):
        assert np.abs(np.diff(field.sizes, axis=axis)).max() <= GROWTH * field.spacing * (1.0 + 1e-9)
    assert size_at(field, 0.0, 0.0, -0.02) == SIZE
    assert field.sizes.min() >= 0.001
    assert (field.start <= -0.02).all()
    assert (field.start + field.spacing * (np.array(field.sizes.shape) - 1) >= 0.02).all()


def test_the_number_of_cells_is_estimated() -> None:
    """The estimate grows with the inverse square of the least size where cells are as long as the wall is thick."""
    counts = [field_of(0.0005, least).cells for least in (0.002, 0.001)]
    assert counts[1] == pytest.approx(4.0 * counts[0], rel=0.2)
    assert field_of(0.0005, 0.001).too_many == []


def test_the_default_size_is_a_fifteenth() -> None:
    """The default size is a fifteenth of the longest side, in two digits."""
    assert default_size(np.array([[0.0, 0.0, 0.0], [0.1, 0.02, 0.03]])) == 0.0067
