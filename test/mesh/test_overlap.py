# SPDX-License-Identifier: Apache-2.0
"""Meshes that lie in each other are found, however little their vertices show it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.overlap import find_overlap
from gdfe_ros.mesh.round_bodies import ring, sphere

BLOCK = bar([1, 1, 1], [2, 2, 2])


def moved(mesh: HexMesh, *by: float, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> HexMesh:
    """Return a mesh turned about the origin by a rotation vector [rad], then moved."""
    return replace(mesh, vertices=Rotation.from_rotvec(turn).apply(mesh.vertices) + by)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.7, -0.3, 1.1)])
@pytest.mark.parametrize(("gap", "apart"), [(1e-9, True), (0.0, True), (-0.049, True), (-0.051, False), (-0.3, False)])
def test_depth_of_blocks_face_to_face(turn: tuple[float, float, float], gap: float, apart: bool) -> None:
    """Put a block before another, touching and deeper: the depth is reported, and where."""
    first, second = moved(BLOCK, 0, 0, 0, turn=turn), moved(BLOCK, 1.0 + gap, 0.2, 0.1)
    second = moved(second, 0, 0, 0, turn=turn)
    found = find_overlap(first, second)
    assert (found is None) == apart
    if found is not None:
        assert found.depth == pytest.approx(-gap, abs=1e-9)
        point = Rotation.from_rotvec(turn).inv().apply(found.point)
        assert point[0] == pytest.approx(1.0, abs=0.6)


def test_bars_that_cross_without_a_vertex_in_the_other() -> None:
    """Cross two bars of one cell: no vertex of either lies in the other; lift one, and they are apart."""
    one, other = bar([10, 1, 1], [1, 1, 1]), moved(bar([10, 1, 1], [1, 1, 1]), 5.0, -5.0, 0.0, turn=(0, 0, np.pi / 2))
    assert find_overlap(one, other).depth == pytest.approx(1.0)
    assert find_overlap(one, moved(other, 0, 0, 1.0)) is None


def test_edges_that_cross() -> None:
    """Lay a bar on its edge across another: only the cross product of their edges separates them."""
    lying = bar([4, 1, 1], [4, 1, 1])
    standing = moved(bar([4, 1, 1], [4, 1, 1]), 0.0, 0.0, 0.0, turn=(np.pi / 4, 0.0, 0.0))
    under = moved(standing, 0.0, 0.0, -np.sqrt(0.5))
    across = moved(moved(standing, -2, 0, np.sqrt(0.5)), 2.0, 0.0, 0.0, turn=(0.0, 0.0, np.pi / 2))
    assert find_overlap(under, moved(across, 0, 0, 1e-6)) is None
    assert find_overlap(under, moved(across, 0, 0, -0.25)) is not None
    assert find_overlap(lying, moved(across, 0, 0, 0.6)) is None


def test_one_inside_of_another() -> None:
    """Hide a small block in a cell of a large one; in the hole of a ring it touches nothing."""
    small = bar([0.1, 0.1, 0.1], [1, 1, 1])
    assert find_overlap(BLOCK, moved(small, 0.2, 0.2, 0.2)) is not None
    assert find_overlap(moved(small, 0.2, 0.2, 0.2), BLOCK) is not None
    assert find_overlap(ring(0.5, [0.1, 0.1], [2, 24, 2]), small) is None
    assert find_overlap(BLOCK, moved(small, 5.0, 0.0, 0.0)) is None


def test_round_bodies_that_touch() -> None:
    """Let two balls touch at their poles, whose cells have faces that are not plane; then press them together."""
    ball = sphere(0.4, 1.0, [6, 2])
    assert find_overlap(ball, moved(ball, 2.0, 0.0, 0.0)) is None
    assert find_overlap(ball, moved(ball, 1.9, 0.0, 0.0)) is not None
    assert find_overlap(ball, sphere(0.1, 0.4, [6, 2])) is None
