# SPDX-License-Identifier: Apache-2.0
"""The benchmark's own definition of the scenes agrees with the scene files."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.cases import CASES, CHEETAH, CaseName, LogNeoHooke, OgdenSeries, rotation_matrix
from gdfe_ros.scene.loader import load_scene


@pytest.mark.parametrize("name", list(CaseName))
def test_the_scene_file_holds_the_same_bar(name: CaseName) -> None:
    """The scene file has the same mesh, the same handles and the same motion."""
    case, scene = CASES[name], load_scene(name.value)
    grid = case.grid()
    np.testing.assert_allclose(scene.mesh.vertices, grid.points(), atol=1e-15)
    np.testing.assert_array_equal(scene.mesh.cells, grid.connectivity())
    handles = {handle.name: handle for handle in scene.handles}
    np.testing.assert_array_equal(handles["base"].vertices, grid.face(right=False))
    np.testing.assert_array_equal(handles["tip"].vertices, grid.face(right=True))
    assert [axis.name.lower() for axis in handles["tip"].free] == (["x"] if case.slides else [])
    pose = scene.program.handle_poses(scene.program.duration)["tip"]
    assert pose.translation == pytest.approx(case.translation)
    assert pose.rotation == pytest.approx(case.rotation)


@pytest.mark.parametrize("name", list(CaseName))
def test_the_scene_file_holds_the_same_materials(name: CaseName) -> None:
    """The scene file has the same material constants in every cell."""
    case, scene = CASES[name], load_scene(name.value)
    materials, laws = list(scene.materials.values()), case.cell_law(case.grid())
    for cell, law in enumerate(laws):
        material, expected = materials[scene.cell_material[cell]], case.laws[law]
        assert material.poisson == expected.poisson
        assert material.bulk == pytest.approx(expected.bulk, rel=1e-12)
        if isinstance(expected, OgdenSeries):
            assert material.mu == pytest.approx(expected.mu)
            assert material.alpha == pytest.approx(expected.alpha)
        else:
            assert material.young == expected.young


def test_bulk_moduli_match_those_of_the_references() -> None:
    """The bulk moduli are those of the reference solutions."""
    assert CHEETAH.bulk == pytest.approx(923.0541623333324e6, rel=1e-12)
    law = LogNeoHooke(young=100.0, poisson=0.25)
    assert (law.mu, law.lame, law.bulk) == pytest.approx((40.0, 40.0, 200.0 / 3.0))


def test_a_turning_handle_keeps_its_shape() -> None:
    """The handle of twist90 rotates rigidly about the bar's axis."""
    case = CASES[CaseName.TWIST90]
    points = case.grid().points()[case.grid().face(right=True)]
    moved = points + case.handle_displacement(points, load=1.0)
    np.testing.assert_allclose(moved[:, 1:], np.stack([-points[:, 2], points[:, 1]], axis=1), atol=1e-15)
    half = points + case.handle_displacement(points, load=0.5)
    np.testing.assert_allclose(np.hypot(*half[:, 1:].T), np.hypot(*points[:, 1:].T), atol=1e-15)


def test_a_sliding_handle_foreshortens_with_the_square_of_the_load() -> None:
    """At half the load, a sliding handle has half of its lift and a quarter of its slide."""
    case = CASES[CaseName.BEND5]
    moved = case.handle_displacement(np.array([[0.5, 0.01, 0.02]]), load=0.5)
    np.testing.assert_allclose(moved, [[-0.0490 / 4, 0.0, 0.1]], atol=1e-15)


def test_rotation_vectors_make_proper_rotations() -> None:
    """A rotation vector rotates by its length about its direction."""
    vector = np.array([0.3, -0.5, 0.9])
    matrix = rotation_matrix(vector)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(matrix @ vector, vector, atol=1e-15)
    assert np.trace(matrix) == pytest.approx(1 + 2 * np.cos(np.linalg.norm(vector)))
    np.testing.assert_array_equal(rotation_matrix(np.zeros(3)), np.eye(3))


def test_cells_that_cut_a_segment_are_refused() -> None:
    """A mesh whose cells straddle two materials is refused."""
    with pytest.raises(ValueError, match="multiple of 5"):
        CASES[CaseName.BEND5].grid((12, 1, 1))
