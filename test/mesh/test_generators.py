# SPDX-License-Identifier: Apache-2.0
"""Generated meshes have the documented numbering, extent and volume."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import bar, check_mesh
from gdfe_ros.mesh.generators import grid


def test_bar_numbers_vertices_and_cells_as_documented() -> None:
    """Vertex i+(nx+1)(j+(ny+1)k) and cell i+nx(j+ny k) are at their places on the grid."""
    nx, ny, nz = 3, 2, 4
    mesh = bar([0.3, 0.2, 0.8], [nx, ny, nz])
    for i, j, k in np.ndindex(nx + 1, ny + 1, nz + 1):
        index = i + (nx + 1) * (j + (ny + 1) * k)
        np.testing.assert_allclose(mesh.vertices[index], [0.1 * i, 0.1 * j - 0.1, 0.2 * k - 0.4], atol=1e-15)
    for i, j, k in np.ndindex(nx, ny, nz):
        expected = [0.1 * (i + 0.5), 0.1 * (j + 0.5) - 0.1, 0.2 * (k + 0.5) - 0.4]
        np.testing.assert_allclose(mesh.centroids[i + nx * (j + ny * k)], expected, atol=1e-15)


def test_bar_is_sound_and_has_its_volume() -> None:
    """A bar is sound and has the volume length x width x height."""
    report = check_mesh(bar([0.5, 0.05, 0.02], [10, 2, 1]))
    assert report.defects == []
    assert report.volume == pytest.approx(0.5 * 0.05 * 0.02, rel=1e-14)
    assert report.min_scaled_jacobian == pytest.approx(1.0)
    assert report.max_aspect == pytest.approx(2.5)


def test_grid_has_the_planes_asked_for() -> None:
    """A block with uneven planes has all planes, and every cell its volume."""
    x, y, z = [0.0, 0.1, 0.4], [-0.2, 0.3], [0.0, 0.01, 0.02, 0.1]
    mesh = grid(x, y, z)
    for axis, planes in enumerate((x, y, z)):
        np.testing.assert_array_equal(np.unique(mesh.vertices[:, axis]), planes)
    assert mesh.n_cells == 2 * 1 * 3
    assert check_mesh(mesh).volume == pytest.approx(0.4 * 0.5 * 0.1, rel=1e-14)


def test_grid_names_every_bad_argument() -> None:
    """A single plane, two equal ones, and one that is no number are refused, each by name."""
    with pytest.raises(MeshError) as caught:
        grid([0.0], [0.0, 0.0, 0.1], [0.0, np.nan])
    assert [defect.split(" ")[0] for defect in caught.value.defects] == ["grid.x", "grid.y", "grid.z"]
