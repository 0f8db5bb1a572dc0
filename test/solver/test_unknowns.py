# SPDX-License-Identifier: Apache-2.0
"""Numbering of the unknowns: free vertices first, then one row for each sliding handle."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.constraints import Axis, Handle
from gdfe_ros.mesh import bar
from gdfe_ros.solver.matrix.unknowns import (
    HandlePositions,
    Unknowns,
    gather_rigid_rows,
    gather_rows,
    number_unknowns,
    place,
)

MESH = bar([0.2, 0.1, 0.1], [2, 1, 1])  # vertices 0, 3, 6, 9 at x-, 2, 5, 8, 11 at x+
LEFT, RIGHT = np.array([0, 3, 6, 9], np.int32), np.array([2, 5, 8, 11], np.int32)
HANDLES = [Handle("base", LEFT, fixed=True), Handle("tip", RIGHT, free=(Axis.X, Axis.Z))]


def test_held_vertices_are_no_unknowns() -> None:
    """With both ends held, the vertices between them are free, and those of the handles are prescribed."""
    unknowns = number_unknowns(MESH.vertices, MESH.cells, HANDLES)
    assert unknowns.free.tolist() == [1, 4, 7, 10]
    assert unknowns.prescribed.tolist() == [*LEFT, *RIGHT]


def test_a_sliding_handle_is_one_row() -> None:
    """A handle with two free axes adds one row, with a flag for each axis."""
    unknowns = number_unknowns(MESH.vertices, MESH.cells, HANDLES)
    assert unknowns.rows == 5
    assert unknowns.slides.tolist() == [[1.0, 0.0, 1.0]]
    assert unknowns.members.tolist() == RIGHT.tolist()
    assert unknowns.member_start.tolist() == [0, 4]


def test_without_handles_everything_is_free() -> None:
    """Without handles every vertex is a row."""
    unknowns = number_unknowns(MESH.vertices, MESH.cells, [])
    assert unknowns.rows == MESH.n_vertices
    assert len(unknowns.prescribed) == 0


def test_each_vertex_lists_its_corners_in_order() -> None:
    """The corner lists contain each corner once, at its own vertex, in ascending order."""
    unknowns = number_unknowns(MESH.vertices, MESH.cells, HANDLES)
    assert sorted(unknowns.corner.tolist()) == list(range(MESH.cells.size))
    for vertex in range(MESH.n_vertices):
        corners = unknowns.corner[unknowns.corner_start[vertex] : unknowns.corner_start[vertex + 1]]
        assert (MESH.cells.ravel()[corners] == vertex).all()
        assert (np.diff(corners) > 0).all()


def test_placing_moves_a_sliding_handle_as_one() -> None:
    """Placing moves free vertices to their unknowns, a handle along its free axes only, and prescribed vertices not."""
    unknowns = number_unknowns(MESH.vertices, MESH.cells, HANDLES)
    u = np.arange(15.0).reshape(5, 3)
    x = MESH.vertices.copy()
    place(u.ravel(), HandlePositions(MESH.vertices, MESH.vertices[RIGHT].mean(axis=0)[None]), unknowns, x)
    np.testing.assert_array_equal(x[unknowns.free], u[:4])
    np.testing.assert_array_equal(x[RIGHT], MESH.vertices[RIGHT] + np.array([12.0, 0.0, 14.0]))
    np.testing.assert_array_equal(x[LEFT], MESH.vertices[LEFT])


def test_gathering_is_the_transpose_of_placing() -> None:
    """Gathering is the transpose of placing: power is the same in rows and in corners."""
    unknowns = number_unknowns(MESH.vertices, MESH.cells, HANDLES)
    random = np.random.default_rng(0)
    u, force = random.normal(size=(5, 3)), random.normal(size=(2, 8, 3))
    x, frame = np.zeros_like(MESH.vertices), HandlePositions(np.zeros_like(MESH.vertices), np.zeros((1, 3)))
    place(u.ravel(), frame, unknowns, x)
    gradient = _gathered(u, x, force, frame, unknowns)
    assert abs(np.vdot(gradient, u) - np.vdot(force, x[MESH.cells])) < 1e-12
    assert gradient[4, 1] == 0.0


@pytest.mark.parametrize("axes", [(Axis.X,), (Axis.X, Axis.Y), (Axis.X, Axis.Y, Axis.Z)])
def test_rows_of_rotations_are_slopes_along_the_rotation_vector(axes: tuple[Axis, ...]) -> None:
    """The gathered gradient of a turned handle is the derivative of the work of dead forces by its rotation vector."""
    tip = Handle("tip", RIGHT, free=(Axis.Z,), turning=axes)
    unknowns = number_unknowns(MESH.vertices, MESH.cells, [HANDLES[0], tip])
    frame = HandlePositions(MESH.vertices, MESH.vertices[RIGHT].mean(axis=0)[None])
    random = np.random.default_rng(1)
    u, way, force = random.normal(size=(6, 3)), random.normal(size=(6, 3)), random.normal(size=(2, 8, 3))
    assert unknowns.turn_row.tolist() == [5]
    x = MESH.vertices.copy()
    place(u.ravel(), frame, unknowns, x)
    gradient = _gathered(u, x, force, frame, unknowns)
    ends = []
    for side in (1.0, -1.0):
        there = MESH.vertices.copy()
        place((u + side * 1e-6 * way).ravel(), frame, unknowns, there)
        ends.append(np.vdot(force, there[MESH.cells]))
    assert np.vdot(gradient, way) == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-7)


def _gathered(
    u: NDArray[np.float64],
    x: NDArray[np.float64],
    force: NDArray[np.float64],
    frame: HandlePositions,
    unknowns: Unknowns,
) -> NDArray[np.float64]:
    gradient = np.zeros_like(u)
    gather_rows(force, unknowns, gradient.ravel())
    gather_rigid_rows(u.ravel(), x, force, np.zeros((0, 3)), False, frame, unknowns, gradient.ravel())
    return gradient
