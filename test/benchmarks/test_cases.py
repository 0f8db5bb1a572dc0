# SPDX-License-Identifier: Apache-2.0
"""The benchmark's own definition of the scenes agrees with the scene files."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.cases import CASES, CaseName, OgdenSeries
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
