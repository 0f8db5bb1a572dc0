# SPDX-License-Identifier: Apache-2.0
"""The fold barrier ("wall") at element corners: its energy, its forces, and where it acts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gdfe_ros.compiled import kernel
from gdfe_ros.mesh.cells.operators import ShapeOperators
from gdfe_ros.mesh.mesh import HexMesh
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.barrier import LINE, NEARLY_FOLDED, THRESHOLD, add_walls, wall
from gdfe_ros.solver.elements.measures import corner_ratios
from gdfe_ros.solver.elements.response import Watch, look


@kernel
def _walls(x, watched, shape, material, table, force, energy):
    add_walls(x, watched, shape, material, table, force, energy)


@kernel
def _look(x, shape, blocks, watch):
    return look(x, shape, blocks, watch)


def walls(body: Body, shape: ShapeOperators, x: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the fold barrier's energy [J] over all elements and its gradient (n, 3) [N]."""
    count = len(body.material)
    force, energy, gradient = np.zeros((count, 8, 3)), np.zeros(count), np.zeros_like(x)
    _walls(x, np.arange(count, dtype=np.int32), shape, body.material, body.table, force, energy)
    np.add.at(gradient, shape.cells, force)
    return float(energy.sum()), gradient


def pressed(mesh: HexMesh, share: float) -> np.ndarray:
    """Return positions with one vertex moved toward the middle by a fraction of its distance; corners become flat."""
    x, random = mesh.vertices.copy(), np.random.default_rng(1)
    x[0] += share * (x.mean(axis=0) - x[0])
    return x + random.normal(scale=0.002 * mesh.size, size=x.shape)


@pytest.mark.parametrize("filled", ["whole", "cut"])
def test_forces_are_the_slopes_of_the_energy(element: HexMesh, make_body: Callable[..., Body], filled: str) -> None:
    """The barrier's forces are the slopes of its energy at flattened corners, of whole and cut cells of four shapes."""
    body = make_body(element)
    shape = body.shape
    if filled == "cut":
        box = np.array([[[0.0, 0.8], [0.1, 1.0], [0.0, 1.0]]])
        ratios = shape.corner_ratio / (0.8 * 0.9)
        shape = shape._replace(cut=np.array([True]), box=box, corner_ratio=ratios)
    for share in (0.9, 1.0, 1.2):
        x, step = pressed(element, share), 1e-7 * element.size
        energy, gradient = walls(body, shape, x)
        assert energy > 0.0
        slopes = np.zeros_like(x)
        for place in np.ndindex(x.shape):
            ahead, behind = x.copy(), x.copy()
            ahead[place] += step
            behind[place] -= step
            slopes[place] = (walls(body, shape, ahead)[0] - walls(body, shape, behind)[0]) / (2.0 * step)
        np.testing.assert_allclose(gradient, slopes, atol=1e-6 * np.abs(slopes).max())
        np.testing.assert_allclose(gradient.sum(axis=0), 0.0, atol=1e-12 * np.abs(gradient).max())


def test_the_wall_begins_smoothly_and_goes_on_straight() -> None:
    """Value, slope and curvature vanish at the threshold; the barrier is (1 - s)^3 / s, and linear below `LINE`."""
    near, step = 1.0 - 1e-6, 1e-3
    assert wall.py_func(near)[0] == pytest.approx(0.0, abs=1e-17)
    assert wall.py_func(near)[1] == pytest.approx(0.0, abs=1e-11)
    assert (wall.py_func(near)[1] - wall.py_func(near - step)[1]) / step == pytest.approx(0.0, abs=0.01)
    for s in (0.9, 0.5, 0.2, 0.11):
        value, slope = wall.py_func(s)
        assert value == pytest.approx((1.0 - s) ** 3 / s)
        assert slope == pytest.approx((wall.py_func(s + 1e-6)[0] - wall.py_func(s - 1e-6)[0]) / 2e-6, rel=1e-5)
    assert wall.py_func(-3.0)[1] == wall.py_func(LINE)[1]
    assert wall.py_func(LINE - 1e-12)[0] == pytest.approx(wall.py_func(LINE)[0])


def test_sound_corners_feel_nothing(distorted: HexMesh, make_body: Callable[..., Body]) -> None:
    """The fold barrier has no energy in a block of skewed cells that is compressed by a third."""
    body = make_body(distorted)
    assert walls(body, body.shape, 0.7 * distorted.vertices)[0] == 0.0


def test_no_corner_folds_within_the_room(distorted: HexMesh, make_body: Callable[..., Body]) -> None:
    """Corners of unwatched elements stay above the threshold while no vertex moves farther than `_look` allows."""
    body = make_body(distorted)
    count, random = len(body.material), np.random.default_rng(3)
    for noise in (0.0, 0.01, 0.02):
        x, watch = distorted.vertices + random.normal(scale=noise, size=body.rest.shape), Watch.over(count)
        room, least = _look(x, body.shape, body.blocks, watch), corner_ratios(x, body.shape)
        np.testing.assert_array_equal(np.sort(watch.watched), np.flatnonzero(least < NEARLY_FOLDED))
        assert 0.0 < room < distorted.size
        for _ in range(200):
            way = random.normal(size=x.shape)
            least = corner_ratios(x + room * way / np.linalg.norm(way, axis=1, keepdims=True), body.shape)
            assert least[~watch.member].min(initial=1.0) >= THRESHOLD
