# SPDX-License-Identifier: Apache-2.0
"""Edges that are open, or whose triangles are wound in opposite directions."""

from __future__ import annotations

import numpy as np
import trimesh

from gdfe_ros.mesh.surface_edges import disagreeing_edges, open_edges_of, winding_defects

BALL = trimesh.creation.icosphere(subdivisions=2)
POINTS, TRIANGLES = np.asarray(BALL.vertices), np.asarray(BALL.faces)


def test_a_sound_surface_has_no_wrong_edges() -> None:
    """A ball has no wrong edges, whether its normals point outwards or inwards."""
    for triangles in (TRIANGLES, TRIANGLES[:, ::-1]):
        assert len(disagreeing_edges(triangles)) == len(open_edges_of(triangles)) == 0
        assert winding_defects(POINTS, triangles) == []


def test_a_turned_triangle_disagrees_with_its_neighbours() -> None:
    """A turned triangle disagrees at its three edges, and the defect names the place."""
    turned = TRIANGLES.copy()
    turned[7] = turned[7, ::-1]
    assert {tuple(edge) for edge in disagreeing_edges(turned)} == {
        tuple(sorted(pair)) for pair in TRIANGLES[7][[[0, 1], [1, 2], [2, 0]]].tolist()
    }
    (text,) = winding_defects(POINTS, turned)
    assert "both sides of 3 edges are wound in opposite directions" in text
    assert "remedy: wind them alike" in text


def test_a_hole_is_open_and_does_not_disagree() -> None:
    """A missing triangle leaves three open edges, and its neighbours agree."""
    assert len(open_edges_of(TRIANGLES[1:])) == 3
    assert len(disagreeing_edges(TRIANGLES[1:])) == 0
