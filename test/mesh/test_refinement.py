# SPDX-License-Identifier: Apache-2.0
"""Refinement of a surface to shorter edges: the same area, closed, and without needless triangles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from gdfe_ros.mesh.surfaces.surface_edges import refine

LONGEST = 0.002
SURFACES: dict[str, Callable[[], trimesh.Trimesh]] = {
    "box": lambda: trimesh.creation.box((0.02, 0.031, 0.007)),
    "tube of thin facets": lambda: trimesh.creation.annulus(0.008, 0.012, 0.12, sections=96),
    "ball": lambda: trimesh.creation.icosphere(subdivisions=1, radius=0.02),
}


@pytest.mark.parametrize("make", SURFACES.values(), ids=SURFACES)
def test_it_is_the_same_surface_without_long_edges(make: Callable[[], trimesh.Trimesh]) -> None:
    """A refined surface is closed, with the same orientation, area and volume, the old points first, and short edges.

    No edge is longer than twice the given length.
    """
    surface = make()
    points, triangles = refine(np.array(surface.vertices), np.array(surface.faces), LONGEST)
    fine = trimesh.Trimesh(points, triangles, process=False)
    assert fine.is_watertight
    assert fine.volume == pytest.approx(surface.volume, rel=1e-12)
    assert fine.area == pytest.approx(surface.area, rel=1e-12)
    np.testing.assert_array_equal(points[: len(surface.vertices)], surface.vertices)
    assert len(np.unique(points, axis=0)) == len(points)
    assert fine.edges_unique_length.max() <= 2.0 * LONGEST
    assert len(triangles) > len(surface.faces)


@pytest.mark.parametrize("width", [1e-5, 5e-4, 1.9e-3])
def test_a_thin_facet_becomes_a_strip(width: float) -> None:
    """A facet of two slender triangles becomes one strip, with triangles in proportion to its length."""
    corners = np.array([[0.0, 0.0, 0.0], [0.12, 0.0, 0.0], [0.12, width, 0.0], [0.0, width, 0.0]])
    _, triangles = refine(corners, np.array([[0, 1, 2], [0, 2, 3]]), LONGEST)
    assert len(triangles) == 2 * (64 + 64 - 1)


def test_short_edges_stay() -> None:
    """A surface with short edges is unchanged."""
    box = trimesh.creation.box((0.001, 0.001, 0.001))
    points, triangles = refine(np.array(box.vertices), np.array(box.faces), LONGEST)
    np.testing.assert_array_equal(points, box.vertices)
    assert {tuple(row) for row in np.sort(triangles, axis=1)} == {tuple(row) for row in np.sort(box.faces, axis=1)}
