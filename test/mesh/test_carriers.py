# SPDX-License-Identifier: Apache-2.0
"""The compiled search for the cells that contain points."""

import numpy as np

from gdfe_ros.mesh import bar
from gdfe_ros.mesh.cells.filling import reference_coordinates, trilinear_weights
from gdfe_ros.mesh.outside import hang


def test_points_in_distorted_cells_get_their_coordinates() -> None:
    """Cells and reference coordinates of points from the trilinear map are found to 1e-12."""
    mesh, random = bar((0.3, 0.2, 0.1), (6, 4, 2)), np.random.default_rng(1)
    vertices = mesh.vertices + random.uniform(-0.008, 0.008, mesh.vertices.shape)
    owner = random.integers(0, mesh.n_cells, 500)
    places = random.uniform(-0.99, 0.99, (500, 3))
    points = np.einsum("ka,kai->ki", trilinear_weights(places), vertices[mesh.cells[owner]])
    cells, weights = hang(vertices, mesh.cells, points)
    assert np.array_equal(cells, owner)
    assert np.abs(weights - trilinear_weights(places)).max() < 1e-12
    slow = reference_coordinates(points, vertices[mesh.cells[owner]])
    assert np.abs(weights - trilinear_weights(slow)).max() < 1e-12


def test_a_point_on_a_face_has_the_cell_with_the_lowest_number() -> None:
    """Points on faces, edges and corners belong to the cell with the lowest number, however they are rounded."""
    mesh = bar((0.3, 0.2, 0.1), (3, 2, 1))
    points = np.repeat(mesh.vertices, 50, axis=0)
    points *= 1.0 + np.random.default_rng(2).uniform(-1e-13, 1e-13, points.shape)
    cells, weights = hang(mesh.vertices, mesh.cells, points)
    lowest = np.array([np.flatnonzero((mesh.cells == vertex).any(axis=1)).min() for vertex in range(mesh.n_vertices)])
    assert np.array_equal(cells, np.repeat(lowest, 50))
    assert np.abs(np.einsum("ka,kai->ki", weights, mesh.vertices[mesh.cells[cells]]) - points).max() < 1e-15


def test_a_point_beyond_the_apex_of_a_tapered_cell_is_outside() -> None:
    """Newton's steps towards a far point meet the apex, where the map is singular: the point is outside, no error."""
    cell = bar((1.0, 1.0, 1.0), (1, 1, 1)).vertices - (0.5, 0.0, 0.0)
    cell[:, 1:] *= 0.75 - 0.5 * cell[:, :1]
    corners = cell[None, bar((1.0, 1.0, 1.0), (1, 1, 1)).cells[0]]
    found = reference_coordinates(np.array([9.0, 0.0, 0.0]), corners)
    assert np.isfinite(found).all()
    assert np.abs(found).max() > 3.0
