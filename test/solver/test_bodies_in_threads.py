# SPDX-License-Identifier: Apache-2.0
"""Factors: each matrix is factored once per process while a body uses it, also with several threads."""

from __future__ import annotations

import gc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gdfe_ros import Simulation
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command
from gdfe_ros.solver.matrix import factor
from gdfe_ros.solver.matrix.factor import factor_of

SCENE = """
name: one_of_many
mesh: {bar: {size: [0.4, 0.1, 0.1], cells: [16, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 300}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
"""


def scene(**overrides: object) -> Scene:
    """Return a bar that hangs under its weight; keyword arguments override scene keys, ``__`` stands for a dot."""
    return scene_from_text(SCENE, overrides={key.replace("__", "."): value for key, value in overrides.items()})


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that grows by the number of vertices of each factor made from now on."""
    found = []

    class WatchedFactor(factor.Factor):
        def __init__(self, matrix: object, points: object) -> None:
            found.append(len(points))
            super().__init__(matrix, points)

    monkeypatch.setattr(factor, "Factor", WatchedFactor)
    return found


def test_equal_bodies_share_a_factor(made: list[int]) -> None:
    """Two equal bodies share a factor; a body with other cells has its own."""
    first, second, third = Simulation(scene()), Simulation(scene()), Simulation(scene(mesh__bar__cells=[17, 4, 4]))
    assert made == [400, 425]
    lifted = [simulation.step(Command(loads={"weight": 2.0})).positions for simulation in (first, second)]
    assert np.array_equal(*lifted)
    assert third.step().converged


def test_a_factor_goes_with_its_last_body(made: list[int]) -> None:
    """A factor is deleted with its last body, and the next equal body makes a new one."""
    simulation = Simulation(scene())
    del simulation
    gc.collect()
    Simulation(scene())
    assert len(made) == 2


def test_bodies_in_threads_are_right() -> None:
    """Four equal bodies with different weights in four threads have the same bits as alone."""
    factors = [0.5, 1.0, 1.5, 2.0]

    def play(weight: float) -> np.ndarray:
        simulation = Simulation(scene())
        steps = [simulation.step(Command(loads={"weight": weight * share})) for share in (0.5, 1.0)]
        return steps[-1].positions

    alone = [play(weight) for weight in factors]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(play, factors))
    for one, other in zip(alone, together, strict=True):
        assert np.array_equal(one, other)


def test_another_matrix_has_another_factor() -> None:
    """A matrix that differs in the last bit of one entry has its own factor; each factor solves its own matrix."""
    random = np.random.default_rng(0)
    root = random.standard_normal((30, 30))
    matrix, points = factor.sparse.csc_matrix(root @ root.T + np.eye(30)), random.standard_normal((30, 3))
    other = matrix.copy()
    other[0, 0] = np.nextafter(matrix[0, 0], np.inf)
    assert factor_of(matrix, points) is not factor_of(other, points)
    kept, right = factor_of(matrix, points), random.standard_normal((30, 3))
    assert factor_of(matrix.copy(), points) is kept
    out = np.empty_like(right)
    kept.solve(right, out)
    np.testing.assert_allclose(matrix @ out, right, atol=1e-9)
