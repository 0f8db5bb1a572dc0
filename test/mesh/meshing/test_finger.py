# SPDX-License-Identifier: Apache-2.0
"""A finger is a tapered bar with notches."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import check_mesh, select_vertices
from gdfe_ros.mesh.generators import finger
from gdfe_ros.mesh.selection import Side, Where

SIZE = [0.1, 0.015, 0.018]


def test_notches_take_their_volume_from_below() -> None:
    """Notches reduce the volume by joints x gap x width x (height - web), and leave one sound piece."""
    mesh = finger(SIZE, joints=3, gap=0.008, web=0.004, cell=0.003)
    report = check_mesh(mesh)
    assert report.defects == []
    assert report.parts == 1
    assert report.volume == pytest.approx(0.1 * 0.015 * 0.018 - 3 * 0.008 * 0.015 * 0.014)
    assert report.volumes[mesh.cell_sets["joints"]].sum() == pytest.approx(3 * 0.008 * 0.015 * 0.004)
    assert len(mesh.cell_sets["joints"]) + len(mesh.cell_sets["links"]) == mesh.n_cells
    assert mesh.centroids[mesh.cell_sets["joints"], 2].min() > 0.018 / 2 - 0.004


def test_taper_scales_the_tip_about_the_axis() -> None:
    """A taper of one half halves width and height at the tip; with tiny notches the volume is a frustum's."""
    mesh = finger(SIZE, joints=1, gap=1e-9, web=0.004, cell=0.005, taper=0.5)
    tip = mesh.vertices[mesh.vertex_sets["tip"]]
    np.testing.assert_allclose(np.abs(tip[:, 1:]).max(axis=0), [0.00375, 0.0045])
    assert check_mesh(mesh).volume == pytest.approx(0.1 * 0.015 * 0.018 * (1 + 0.5 + 0.25) / 3, rel=1e-6)


def test_sets_are_the_end_faces() -> None:
    """The sets are the faces at the ends of the bounding box."""
    mesh = finger(SIZE, joints=2, gap=0.01, web=0.005, cell=0.005, taper=0.8)
    np.testing.assert_array_equal(mesh.vertex_sets["base"], select_vertices(mesh, Where(face=Side.X_LOW)))
    np.testing.assert_array_equal(mesh.vertex_sets["tip"], select_vertices(mesh, Where(face=Side.X_HIGH)))


def test_cells_are_no_larger_than_asked() -> None:
    """Every edge is shorter than the cell size."""
    mesh = finger(SIZE, joints=2, gap=0.01, web=0.005, cell=0.004)
    assert np.ptp(mesh.vertices[mesh.cells], axis=1).max() <= 0.004 + 1e-12


def test_arguments_that_do_not_fit_are_all_named() -> None:
    """Gaps longer than the finger, and a web as high as it are reported together."""
    with pytest.raises(MeshError) as caught:
        finger(SIZE, joints=5, gap=0.03, web=0.02, cell=0.003)
    assert len(caught.value.defects) == 2
