# SPDX-License-Identifier: Apache-2.0
"""Overlapping meshes are found, also if no vertex of one is inside the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.generators import ring, sphere
from gdfe_ros.mesh.overlap import find_overlap

BLOCK = bar([1, 1, 1], [2, 2, 2])


def moved(mesh: HexMesh, *by: float, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> HexMesh:
    """Return a mesh rotated about the origin by a rotation vector [rad] and then moved."""
    return replace(mesh, vertices=Rotation.from_rotvec(turn).apply(mesh.vertices) + by)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.7, -0.3, 1.1)])
@pytest.mark.parametrize(("gap", "apart"), [(1e-9, True), (0.0, True), (-0.049, True), (-0.051, False), (-0.3, False)])
def test_depth_of_blocks_face_to_face(turn: tuple[float, float, float], gap: float, apart: bool) -> None:
    """Blocks overlap if their depth exceeds a tenth of a cell's edge; depth and a nearby point are then reported."""
    first, second = moved(BLOCK, 0, 0, 0, turn=turn), moved(BLOCK, 1.0 + gap, 0.2, 0.1)
    second = moved(second, 0, 0, 0, turn=turn)
    found = find_overlap(first, second)
    assert (found is None) == apart
    if found is not None:
        assert found.depth == pytest.approx(-gap, abs=1e-9)
        point = Rotation.from_rotvec(turn).inv().apply(found.point)
        assert point[0] == pytest.approx(1.0, abs=0.6)


def test_bars_that_cross_without_a_vertex_in_the_other() -> None:
    """Two crossed bars overlap without a vertex inside the other, and do not if one is lifted."""
    one, other = bar([10, 1, 1], [1, 1, 1]), moved(bar([10, 1, 1], [1, 1, 1]), 5.0, -5.0, 0.0, turn=(0, 0, np.pi / 2))
    assert find_overlap(one, other).depth == pytest.approx(1.0)
    assert find_overlap(one, moved(other, 0, 0, 1.0)) is None


def test_edges_that_cross() -> None:
    """For a bar on its edge across another, only the cross product of their edges separates them."""
    lying = bar([4, 1, 1], [4, 1, 1])
    standing = moved(bar([4, 1, 1], [4, 1, 1]), 0.0, 0.0, 0.0, turn=(np.pi / 4, 0.0, 0.0))
    under = moved(standing, 0.0, 0.0, -np.sqrt(0.5))
    across = moved(moved(standing, -2, 0, np.sqrt(0.5)), 2.0, 0.0, 0.0, turn=(0.0, 0.0, np.pi / 2))
    assert find_overlap(under, moved(across, 0, 0, 1e-6)) is None
    assert find_overlap(under, moved(across, 0, 0, -0.25)) is not None
    assert find_overlap(lying, moved(across, 0, 0, 0.6)) is None


def test_one_inside_of_another() -> None:
    """A small block inside a cell of a large one overlaps; in the hole of a ring it does not."""
    small = bar([0.1, 0.1, 0.1], [1, 1, 1])
    assert find_overlap(BLOCK, moved(small, 0.2, 0.2, 0.2)) is not None
    assert find_overlap(moved(small, 0.2, 0.2, 0.2), BLOCK) is not None
    assert find_overlap(ring(0.5, [0.1, 0.1], [2, 24, 2]), small) is None
    assert find_overlap(BLOCK, moved(small, 5.0, 0.0, 0.0)) is None


def test_round_bodies_that_touch() -> None:
    """Balls that touch at their poles do not overlap, though their faces are not plane; pressed together they do."""
    ball = sphere(0.4, 1.0, [6, 2])
    assert find_overlap(ball, moved(ball, 2.0, 0.0, 0.0)) is None
    assert find_overlap(ball, moved(ball, 1.9, 0.0, 0.0)) is not None
    assert find_overlap(ball, sphere(0.1, 0.4, [6, 2])) is None
