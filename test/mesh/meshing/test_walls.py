# SPDX-License-Identifier: Apache-2.0
"""Thickness of walls: exact for plates and shells; sharp edges are no walls; fractions are those of areas."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gdfe_ros.mesh.meshing.walls import Walls, find_walls


def walls_of(mesh: trimesh.Trimesh, spacing: float) -> Walls:
    """Return the walls of a surface."""
    return find_walls(np.asarray(mesh.vertices), np.asarray(mesh.faces), spacing=spacing)


def test_a_plate_is_as_thick_as_it_is() -> None:
    """The faces of a plate have the distance of the opposite faces, and the fractions of the areas."""
    walls = walls_of(trimesh.creation.box((0.1, 0.06, 0.002)), 0.005)
    for thickness, area in ((0.002, 2 * 0.1 * 0.06), (0.06, 2 * 0.1 * 0.002), (0.1, 2 * 0.06 * 0.002)):
        assert walls.areas[np.isclose(walls.thickness, thickness, rtol=1e-9)].sum() == pytest.approx(area, rel=1e-9)
    assert walls.thickness[walls.thinnest] == pytest.approx(0.002)
    assert walls.fraction(walls.thickness < 0.004) == pytest.approx(0.012 / walls.areas.sum())


@pytest.mark.parametrize("subdivisions", [3, 4])
def test_a_hollow_ball_is_as_thick_as_its_shell(subdivisions: int) -> None:
    """The thickness of a shell between two concentric balls is the difference of the radii, up to the facets."""
    outer = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.03)
    inner = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.027)
    inner.invert()
    walls = walls_of(trimesh.util.concatenate([outer, inner]), 0.01)
    np.testing.assert_allclose(walls.thickness, 0.003, rtol=0.03 if subdivisions == 4 else 0.1)


def test_the_thinnest_place_of_a_large_face_is_found() -> None:
    """A pocket that leaves 1 mm of a block is found although the face over it has two triangles."""
    block, pocket = trimesh.creation.box((0.1, 0.1, 0.02)), trimesh.creation.box((0.02, 0.01, 0.01))
    pocket.apply_translation((0.02, 0.03, 0.004))
    pocket.invert()
    walls = walls_of(trimesh.util.concatenate([block, pocket]), 0.004)
    assert walls.thickness[walls.thinnest] == pytest.approx(0.001)
    thin = walls.places[np.isclose(walls.thickness, 0.001)]
    assert np.abs(thin[:, :2] - (0.02, 0.03)).max() <= 0.01
    assert set(np.round(thin[:, 2], 6)) == {0.009, 0.01}


@pytest.mark.parametrize(("angle", "wall"), [(60.0, False), (30.0, True)])
def test_a_blunt_edge_is_no_wall(angle: float, wall: bool) -> None:
    """Two faces that enclose more than 45 degrees are no wall; near a sharper edge the wall becomes thin."""
    rise = np.tan(np.deg2rad(0.5 * angle))
    points = np.array([[0, 0], [1, rise], [1, -rise]])
    low, high = np.insert(points, 1, 0.0, axis=1), np.insert(points, 1, 1.0, axis=1)
    wedge = trimesh.Trimesh(*_hull(np.concatenate([low, high])), process=False)
    walls = walls_of(wedge, 0.05)
    assert bool(walls.thickness.min() < 0.1) is wall


def _hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and outward triangles of the convex hull of points."""
    hull = trimesh.convex.convex_hull(points)
    return np.asarray(hull.vertices), np.asarray(hull.faces)


def test_the_number_of_rays_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    """A spacing that would need too many rays is enlarged."""
    monkeypatch.setattr("gdfe_ros.mesh.meshing.walls.MOST_RAYS", 2000)
    assert len(walls_of(trimesh.creation.box((0.1, 0.1, 0.1)), 1e-5).places) < 20_000
