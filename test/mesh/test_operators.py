# SPDX-License-Identifier: Apache-2.0
"""Shape operators of general hexahedra: exact averages, hourglass modes without linear fields, symmetries."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.mesh import bar
from gdfe_ros.mesh.operators import ShapeOperators, shape_operators
from gdfe_ros.mesh.trilinear import CORNERS, MODES

CELL = np.arange(8, dtype=np.int32)[None]
CUBE = 0.5 + 0.5 * CORNERS
SHEARED = CUBE @ np.array([[2.0, 0.3, 0.1], [0.0, 1.0, 0.4], [0.0, 0.0, 0.5]])


def distorted(seed: int = 0) -> NDArray[np.float64]:
    """Return a unit cube whose corners are displaced at random by up to 0.2."""
    return CUBE + np.random.default_rng(seed).uniform(-0.2, 0.2, (8, 3))


def operators(corners: NDArray[np.float64]) -> ShapeOperators:
    """Return the operators of one element with these corners."""
    return shape_operators(np.ascontiguousarray(corners), CELL)


def gauss_average(corners: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return the volume and the mean shape gradients (8, 3) by 4 x 4 x 4 points and differences of the shapes."""
    points, weights = np.polynomial.legendre.leggauss(4)
    volume, total = 0.0, np.zeros((8, 3))
    for index in np.ndindex(4, 4, 4):
        factors = 1.0 + CORNERS * points[list(index)]
        others = np.stack([factors[:, 1] * factors[:, 2], factors[:, 0] * factors[:, 2], factors[:, 0] * factors[:, 1]])
        local = 0.125 * CORNERS * others.T
        jacobian = corners.T @ local
        weight = np.prod(weights[list(index)]) * np.linalg.det(jacobian)
        volume += weight
        total += weight * local @ np.linalg.inv(jacobian)
    return volume, total / volume


@pytest.mark.parametrize("seed", range(5))
def test_averages_are_exact_on_distorted_elements(seed: int) -> None:
    """Volume and mean gradient equal those with twice as many integration points."""
    corners = distorted(seed)
    found = operators(corners)
    volume, gradient = gauss_average(corners)
    assert found.volume[0] == pytest.approx(volume, rel=1e-13)
    np.testing.assert_allclose(found.gradient[0], gradient, atol=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_gradient_is_the_slope_of_the_volume(seed: int) -> None:
    """V g_a is the derivative of the volume with respect to corner a (Flanagan and Belytschko)."""
    corners, step = distorted(seed), 1e-5
    found = operators(corners)
    for corner in np.ndindex(8, 3):
        move = np.zeros((8, 3))
        move[corner] = step
        slope = (operators(corners + move).volume[0] - operators(corners - move).volume[0]) / (2.0 * step)
        assert found.volume[0] * found.gradient[0][corner] == pytest.approx(slope, abs=1e-9)


@pytest.mark.parametrize("corners", [CUBE, SHEARED, distorted()], ids=["cube", "sheared", "distorted"])
def test_mean_gradient_of_a_linear_field_is_exact(corners: NDArray[np.float64]) -> None:
    """For a linear field with gradient F, sum_a x_a (x) g_a is F."""
    gradient = np.random.default_rng(1).normal(size=(3, 3))
    moved = corners @ gradient.T + np.array([3.0, -2.0, 1.0])
    np.testing.assert_allclose(moved.T @ operators(corners).gradient[0], gradient, atol=1e-12)


@pytest.mark.parametrize("corners", [CUBE, SHEARED, distorted()], ids=["cube", "sheared", "distorted"])
def test_hourglass_vectors_ignore_linear_fields(corners: NDArray[np.float64]) -> None:
    """Hourglass vectors are zero for constant and linear fields, are unit vectors, and span four modes."""
    vectors = operators(corners).hourglass[0]
    np.testing.assert_allclose(vectors @ np.ones(8), 0.0, atol=1e-14)
    np.testing.assert_allclose(vectors @ corners, 0.0, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0)
    assert np.linalg.matrix_rank(vectors) == 4


def test_gradient_and_hourglass_vectors_span_all_that_deforms() -> None:
    """The constant, the gradients and the hourglass vectors are a basis for the values at eight corners."""
    found = operators(distorted())
    basis = np.vstack([np.ones(8), found.gradient[0].T, found.hourglass[0]])
    assert np.linalg.matrix_rank(basis) == 8


@pytest.mark.parametrize("corners", [CUBE, SHEARED], ids=["cube", "sheared"])
def test_hourglass_vectors_of_a_parallelepiped_are_the_modes(corners: NDArray[np.float64]) -> None:
    """The hourglass vectors of a parallelepiped are the sign patterns over sqrt 8."""
    np.testing.assert_allclose(operators(corners).hourglass[0], MODES / np.sqrt(8.0), atol=1e-15)


def test_modes_lack_the_axis_that_they_are_named_after() -> None:
    """Mode i does not change along axis i, and the other modes change their sign."""
    for axis in range(3):
        partner = [int(np.flatnonzero((other == corner).all(axis=1))[0]) for other, corner in _mirrored(axis)]
        np.testing.assert_array_equal(MODES[axis][partner], MODES[axis])
        for mode in set(range(4)) - {axis}:
            np.testing.assert_array_equal(MODES[mode][partner], -MODES[mode])


def _mirrored(axis: int) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    flip = np.ones(3)
    flip[axis] = -1.0
    return [(CORNERS, corner * flip) for corner in CORNERS]


def test_edges_of_a_box() -> None:
    """The edges of a box of 4 x 2 x 1 are along the axes and have these lengths."""
    found = operators(CUBE * (4.0, 2.0, 1.0))
    np.testing.assert_allclose(found.edge_axes[0], np.eye(3), atol=1e-15)
    np.testing.assert_allclose(found.edge_lengths[0], (4.0, 2.0, 1.0))
    np.testing.assert_allclose(found.reference[0], np.diag([0.5, 1.0, 2.0]))
    assert found.volume[0] == pytest.approx(8.0)


def test_edges_turn_with_the_element() -> None:
    """The edge directions of a rotated sheared element rotate with it, and the lengths stay."""
    turn = Rotation.from_rotvec([0.3, 1.0, -0.7]).as_matrix()
    here, there = operators(SHEARED), operators(SHEARED @ turn.T)
    np.testing.assert_allclose(there.edge_axes[0], here.edge_axes[0] @ turn.T, atol=1e-14)
    np.testing.assert_allclose(there.edge_lengths, here.edge_lengths)


@pytest.mark.parametrize(
    ("corners", "parallel"),
    [(CUBE, True), (SHEARED, True), (1e-3 * SHEARED + 1.0, True), (distorted(), False)],
    ids=["cube", "sheared", "far-away", "distorted"],
)
def test_parallelepipeds_are_recognised(corners: NDArray[np.float64], parallel: bool) -> None:
    """Parallelepipeds, for which the sign patterns are exact, are recognised, other elements are not."""
    assert bool(operators(corners).parallel[0]) is parallel


@pytest.mark.parametrize("bump", [1e-3, 1e-6])
def test_a_small_bump_makes_a_general_element(bump: float) -> None:
    """With one corner moved by a millionth of the edge, an element is no parallelepiped."""
    corners = CUBE.copy()
    corners[6, 0] += bump
    assert not operators(corners).parallel[0]


def test_operators_scale_with_the_element() -> None:
    """In an element 1000 times smaller, the volume scales by the cube, the gradient by the inverse, hourglass not."""
    here, there = operators(distorted()), operators(1e-3 * distorted())
    assert there.volume[0] == pytest.approx(1e-9 * here.volume[0], rel=1e-12)
    np.testing.assert_allclose(there.gradient, 1e3 * here.gradient, rtol=1e-10)
    np.testing.assert_allclose(there.hourglass, here.hourglass, atol=1e-12)
    np.testing.assert_allclose(there.edge_lengths, 1e-3 * here.edge_lengths, rtol=1e-12)


def test_renumbering_vertices_changes_nothing() -> None:
    """Renumbering a bar's vertices leaves each element's operators unchanged bit by bit."""
    mesh = bar([0.3, 0.2, 0.1], [3, 2, 1])
    order = np.random.default_rng(0).permutation(mesh.n_vertices)
    inverse = np.argsort(order)
    here = shape_operators(mesh.vertices, mesh.cells)
    there = shape_operators(mesh.vertices[order], inverse[mesh.cells].astype(np.int32))
    for name in ("volume", "gradient", "hourglass", "edge_axes", "edge_lengths", "reference", "parallel"):
        np.testing.assert_array_equal(getattr(there, name), getattr(here, name))


def test_volumes_fill_the_bar() -> None:
    """The cell volumes of a distorted bar with a straight surface sum to the bar's volume."""
    mesh = bar([0.3, 0.2, 0.2], [3, 3, 3])
    inside = np.setdiff1d(np.arange(mesh.n_vertices), mesh.surface())
    vertices = mesh.vertices.copy()
    vertices[inside] += np.random.default_rng(0).uniform(-0.02, 0.02, (len(inside), 3))
    assert shape_operators(vertices, mesh.cells).volume.sum() == pytest.approx(0.012, rel=1e-13)


def test_arrays_suit_the_kernels() -> None:
    """The operators' arrays are float64 and int32, C-contiguous, with one row per element."""
    mesh = bar([0.3, 0.2, 0.1], [3, 2, 1])
    found = shape_operators(mesh.vertices, mesh.cells)
    assert found.cells.dtype == np.int32
    assert found.parallel.dtype == np.bool_
    for array in found:
        assert len(array) == mesh.n_cells
        assert array.flags.c_contiguous
        assert array.dtype in (np.int32, np.bool_, np.float64)
