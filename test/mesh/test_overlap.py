# SPDX-License-Identifier: Apache-2.0
"""Meshes that overlap each other, and surfaces that cut themselves, are found, and those that touch are not."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.generators import ring, sphere
from gdfe_ros.mesh.overlap import find_overlap, find_self_cuts

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


BOX = trimesh.creation.box((1.0, 1.0, 1.0))


def cuts_of(*parts: trimesh.Trimesh):
    """Return the self-intersections of several surfaces together."""
    whole = trimesh.util.concatenate(list(parts))
    return find_self_cuts(np.asarray(whole.vertices), np.asarray(whole.faces))


def shifted(mesh: trimesh.Trimesh, *shift: float) -> trimesh.Trimesh:
    """Return a copy of a surface at another place."""
    return mesh.copy().apply_translation(shift)


def pierced(ends: np.ndarray, corners: np.ndarray) -> bool:
    """Return whether a segment (2, 3) pierces a triangle (3, 3), by the signs of volumes of tetrahedra."""

    def volume(*p: np.ndarray) -> float:
        return float(np.linalg.det(np.stack(p[1:]) - p[0]))

    a, b, c = corners
    if volume(ends[0], a, b, c) * volume(ends[1], a, b, c) >= 0.0:
        return False
    sides = [volume(ends[0], ends[1], *pair) for pair in ((a, b), (b, c), (c, a))]
    return min(sides) > 0.0 or max(sides) < 0.0


def test_random_triangles_are_counted_as_by_brute_force() -> None:
    """Among 60 random triangles, the pairs are those of which an edge pierces the other triangle."""
    random = np.random.default_rng(5)
    corners = random.uniform(size=(60, 1, 3)) + 0.4 * random.uniform(-1.0, 1.0, size=(60, 3, 3))
    pairs = set()
    for i in range(60):
        for j in range(i + 1, 60):
            for own, other in ((i, j), (j, i)):
                edges = corners[own][[[0, 1], [1, 2], [2, 0]]]
                if any(pierced(edge, corners[other]) for edge in edges):
                    pairs.add((i, j))
    found = find_self_cuts(corners.reshape(-1, 3), np.arange(180).reshape(-1, 3))
    assert found.pairs == len(pairs) > 50
    assert set(np.flatnonzero(found.cut)) == {k for pair in pairs for k in pair}


@pytest.mark.parametrize("shift", [(0.5, 0.3, 0.2), (0.5, 0.3, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.2, 0.0)])
def test_boxes_that_overlap_or_share_a_part_of_a_face_are_told(shift: tuple[float, float, float]) -> None:
    """Boxes in general position, with flush faces, in the same place or side by side lie in or on each other."""
    found = cuts_of(BOX, shifted(BOX, *shift))
    assert found.pairs > 0
    assert "cuts itself" in found.defects[0]
    inside = np.abs(found.places - np.array(shift)).max(axis=1) <= 0.5 + 1e-6
    assert (inside & (np.abs(found.places).max(axis=1) <= 0.5 + 1e-6)).any()


@pytest.mark.parametrize("shift", [(1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (1.001, 0.0, 0.0), (0.0, 3.0, 0.0)])
def test_surfaces_that_touch_or_are_apart_do_not_cut_each_other(shift: tuple[float, float, float]) -> None:
    """Boxes with a common edge or corner, or with a gap, do not cut each other."""
    found = cuts_of(BOX, shifted(BOX, *shift))
    assert found.pairs == 0
    assert found.defects == []


def test_a_fold_onto_a_neighbour_is_an_overlap() -> None:
    """Two triangles with a common edge overlap if both are on the same side of it, and touch if not."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0.3, 1, 0], [0.6, 0.5, 0], [0.6, -0.5, 0]], dtype=float)
    assert find_self_cuts(points, np.array([[0, 1, 2], [1, 0, 3]])).pairs == 1
    assert find_self_cuts(points, np.array([[0, 1, 2], [1, 0, 4]])).pairs == 0


def test_neighbours_at_a_corner_that_cut_each_other_are_told() -> None:
    """Two triangles with one common corner cut each other if they do beyond it."""
    points = np.array([[0, 0, 0], [1, -1, 0], [1, 1, 0], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [-1, 0, -1]], dtype=float)
    assert find_self_cuts(points, np.array([[0, 1, 2], [0, 3, 4]])).pairs == 1
    assert find_self_cuts(points, np.array([[0, 1, 2], [0, 5, 6]])).pairs == 0


def test_the_count_does_not_depend_on_frame_unit_and_order() -> None:
    """The count is the same in another frame, in another unit and with triangles in another order."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    both = trimesh.util.concatenate([ball, shifted(ball, 0.7, 0.1, 0.05)])
    points, triangles = np.asarray(both.vertices), np.asarray(both.faces)
    wanted = find_self_cuts(points, triangles).pairs
    turned = trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.6, 0.2]))[:3, :3]
    assert wanted > 50
    assert find_self_cuts(1e-3 * points @ turned.T + 0.2, triangles).pairs == wanted
    order = np.random.default_rng(1).permutation(len(triangles))
    assert find_self_cuts(points, triangles[order]).pairs == wanted


def test_a_hundred_thousand_triangles_take_seconds() -> None:
    """Two balls of 164 000 triangles together that cut each other take at most a few seconds of processor time."""
    ball = trimesh.creation.icosphere(subdivisions=6)
    cuts_of(BOX)
    began = time.process_time()
    found = cuts_of(ball, shifted(ball, 0.7, 0.1, 0.05))
    assert time.process_time() - began < 10.0
    radius = np.hypot(1.0, 0.0) ** 2 - 0.25 * (0.7**2 + 0.1**2 + 0.05**2)
    middle = np.array([0.35, 0.05, 0.025])
    away = np.linalg.norm(found.places - middle, axis=1)
    np.testing.assert_allclose(away, np.sqrt(radius), rtol=1e-3)


def test_places_are_in_the_order_of_the_triangles() -> None:
    """The place of each triangle that is cut is within the triangle's bounding box."""
    box = trimesh.creation.box((1.0, 1.0, 1.0)).subdivide()
    both = trimesh.util.concatenate([box, box.copy().apply_translation((0.55, 0.35, 0.15))])
    found = find_self_cuts(np.asarray(both.vertices), np.asarray(both.faces))
    corners = both.triangles[found.cut]
    assert len(corners) == len(found.places) > 4
    assert (found.places >= corners.min(axis=1) - 1e-9).all()
    assert (found.places <= corners.max(axis=1) + 1e-9).all()
