# SPDX-License-Identifier: Apache-2.0
"""A grid numbers its nodes as the paper's meshes do, and interpolates with its element's polynomial."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.grids import HEXAHEDRON8, HEXAHEDRON20, Grid

SIZE = (0.5, 0.05, 0.04)


def _inside(count: int = 200) -> np.ndarray:
    unit = np.random.default_rng(3).random((count, 3))
    return unit * SIZE - [0.0, SIZE[1] / 2, SIZE[2] / 2]


def test_nodes_follow_the_formula_of_the_scenes() -> None:
    """Node (i, j, k) has the index i + (nx+1)(j + (ny+1)k), with x from 0, and y and z centred."""
    grid = Grid(size=SIZE, cells=(5, 3, 2))
    index = 4 + 6 * (1 + 4 * 2)
    np.testing.assert_allclose(grid.points()[index], [0.4, -0.025 + 0.05 / 3, 0.02], atol=1e-15)
    assert len(grid.points()) == 6 * 4 * 3


@pytest.mark.parametrize("order", [1, 2])
def test_cells_fill_the_bar_with_positive_orientation(order: int) -> None:
    """Every cell has a positive volume, and all cells together have the bar's."""
    grid = Grid(size=SIZE, cells=(5, 3, 2), order=order)
    corners = grid.points()[grid.connectivity(HEXAHEDRON8)]
    edges = corners[:, [1, 3, 4]] - corners[:, :1]
    volumes = np.linalg.det(edges)
    assert volumes.min() > 0
    np.testing.assert_allclose(volumes.sum(), np.prod(SIZE), rtol=1e-13)


def test_faces_lie_at_the_ends() -> None:
    """The end faces have exactly the nodes at x = 0 and at x = L."""
    grid = Grid(size=SIZE, cells=(5, 3, 2), order=2)
    x = grid.points()[:, 0]
    np.testing.assert_array_equal(grid.face(right=False), np.nonzero(x == 0.0)[0])
    np.testing.assert_array_equal(grid.face(right=True), np.nonzero(x == SIZE[0])[0])


def _trilinear(p: np.ndarray) -> np.ndarray:
    x, y, z = p.T
    return np.stack([1 + 2 * x - y + 3 * z, x * y * z, x * z - y * z + 5 * x * y], axis=1)


def _serendipity(p: np.ndarray) -> np.ndarray:
    x, y, z = p.T
    return np.stack([x**2 * y * z, y**2 * x - z**2, x * y * z + x**2 - 3 * z**2 * x * y], axis=1)


def _triquadratic(p: np.ndarray) -> np.ndarray:
    x, y, z = p.T
    return np.stack([x**2 * y**2 * z**2, x**2 * y * z**2, y**2 * z**2 - x], axis=1)


@pytest.mark.parametrize(("order", "field"), [(1, _trilinear), (2, _trilinear), (2, _serendipity), (2, _triquadratic)])
def test_interpolation_is_exact_for_the_elements_own_polynomials(order: int, field) -> None:
    """Interpolation reproduces a polynomial of the element's space in the bar and at the nodes of its boundary."""
    grid = Grid(size=SIZE, cells=(4, 3, 2), order=order)
    points = np.concatenate([_inside(), grid.points()])
    exact = field(points)
    np.testing.assert_allclose(grid.evaluate(field(grid.points()), points), exact, atol=1e-13 * np.abs(exact).max())


def test_serendipity_lattice_is_completed_by_the_elements_own_shape() -> None:
    """Face and body centres are filled so that the lattice interpolates like the 20-node element."""
    grid, points = Grid(size=SIZE, cells=(4, 3, 2), order=2), _inside()
    values = _serendipity(grid.points())
    holes = np.setdiff1d(np.arange(len(values)), grid.connectivity(HEXAHEDRON20))
    values[holes] = np.nan
    filled = grid.complete_serendipity(values)
    np.testing.assert_allclose(grid.evaluate(filled, points), _serendipity(points), atol=1e-14)


def test_points_outside_the_bar_are_refused() -> None:
    """Points outside the bar are refused and named."""
    grid = Grid(size=SIZE, cells=(4, 3, 2))
    with pytest.raises(ValueError, match=r"points \[1\] lie outside"):
        grid.evaluate(grid.points(), np.array([[0.1, 0.0, 0.0], [0.6, 0.0, 0.0]]))
