# SPDX-License-Identifier: Apache-2.0
"""Self-intersections of surfaces: counted as by brute force; touching is none; invariant; fast."""

from __future__ import annotations

import time

import numpy as np
import pytest
import trimesh

from gdfe_ros.mesh.overlap import find_self_cuts

BOX = trimesh.creation.box((1.0, 1.0, 1.0))


def cuts_of(*parts: trimesh.Trimesh):
    """Return the self-intersections of several surfaces together."""
    whole = trimesh.util.concatenate(list(parts))
    return find_self_cuts(np.asarray(whole.vertices), np.asarray(whole.faces))


def moved(mesh: trimesh.Trimesh, *shift: float) -> trimesh.Trimesh:
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
    found = cuts_of(BOX, moved(BOX, *shift))
    assert found.pairs > 0
    assert "cuts itself" in found.defects[0]
    inside = np.abs(found.places - np.array(shift)).max(axis=1) <= 0.5 + 1e-6
    assert (inside & (np.abs(found.places).max(axis=1) <= 0.5 + 1e-6)).any()


@pytest.mark.parametrize("shift", [(1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (1.001, 0.0, 0.0), (0.0, 3.0, 0.0)])
def test_surfaces_that_touch_or_are_apart_do_not_cut_each_other(shift: tuple[float, float, float]) -> None:
    """Boxes with a common edge or corner, or with a gap, do not cut each other."""
    found = cuts_of(BOX, moved(BOX, *shift))
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
    both = trimesh.util.concatenate([ball, moved(ball, 0.7, 0.1, 0.05)])
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
    found = cuts_of(ball, moved(ball, 0.7, 0.1, 0.05))
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
