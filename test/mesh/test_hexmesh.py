# SPDX-License-Identifier: Apache-2.0
"""The mesh container converts its arrays and finds its surface."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, bar


def test_surface_counts_boundary_quads_once() -> None:
    """An a x b x c grid has 2 (ab + bc + ca) boundary quads, each with a cell that contains it."""
    mesh = bar([1, 1, 1], [4, 3, 2])
    quads, cells = mesh.boundary.quads, mesh.boundary.cells
    assert quads.shape == (2 * (12 + 6 + 8), 4)
    assert quads.dtype == np.int32
    assert all(set(quad) <= set(cell) for quad, cell in zip(quads, mesh.cells[cells], strict=True))


def test_surface_does_not_depend_on_vertex_numbers() -> None:
    """After a permutation of the vertices the surface has the same quads."""
    mesh = bar([1, 1, 1], [3, 2, 2])
    new = np.random.default_rng(1).permutation(mesh.n_vertices).astype(np.int32)
    vertices = np.empty_like(mesh.vertices)
    vertices[new] = mesh.vertices
    np.testing.assert_array_equal(HexMesh(vertices, new[mesh.cells]).surface(), new[mesh.surface()])


def test_geometry_of_a_bar() -> None:
    """A bar's bounds and diagonal are in metres."""
    mesh = bar([3.0, 4.0, 12.0], [1, 1, 1])
    np.testing.assert_array_equal(mesh.bounds, [[0, -2, -6], [3, 2, 6]])
    assert mesh.size == pytest.approx(13.0)


def test_arrays_of_another_type_are_converted_and_sets_sorted() -> None:
    """Lists and int64 arrays are accepted; sets are sorted and made unique."""
    mesh = bar([1, 1, 1], [2, 1, 1])
    copy = HexMesh(mesh.vertices.tolist(), mesh.cells.astype(np.int64), {"a": np.array([1, 0, 1])})
    assert copy.cells.dtype == np.int32
    assert copy.cell_sets["a"].tolist() == [0, 1]


def test_wrong_shapes_are_named_together() -> None:
    """Wrong shapes of vertices and cells are reported together with the allowed ones."""
    with pytest.raises(MeshError) as caught:
        HexMesh(np.zeros((4, 2)), np.zeros((1, 4)))
    assert len(caught.value.defects) == 3
    assert "(n, 3)" in str(caught.value)
    assert "(m, 8)" in str(caught.value)


def test_a_mesh_is_printed_in_one_line() -> None:
    """A mesh is printed in one line with kinds, counts and size, without its arrays."""
    assert repr(bar([0.5, 0.2, 0.1], [5, 3, 2])) == "HexMesh(30 cells, 72 vertices, 0.5 x 0.2 x 0.1 m)"
