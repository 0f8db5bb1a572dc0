# SPDX-License-Identifier: Apache-2.0
"""Factors: each matrix is factored once per process while a body uses it, also with several threads."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from gdfe_ros.simulation import Command
from gdfe_ros.solver.matrix import constant_matrix
from gdfe_ros.solver.matrix.constant_matrix import factor_of
from test.written import simulate

SCENE = """
mesh: {bar: {size: [0.4, 0.1, 0.1], cells: [16, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 300}}
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
"""


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that grows by the number of vertices of each factor made from now on."""
    found = []

    class WatchedFactor(constant_matrix.Factor):
        def __init__(self, matrix: object, points: object) -> None:
            found.append(len(points))
            super().__init__(matrix, points)

    monkeypatch.setattr(constant_matrix, "Factor", WatchedFactor)
    return found


def test_equal_bodies_share_a_factor(made: list[int]) -> None:
    """Two equal bodies share a factor; a body with other cells has its own."""
    first, second, third = simulate(SCENE), simulate(SCENE), simulate(SCENE, mesh__bar__cells=[17, 4, 4])
    assert made == [400, 425]
    lifted = [simulation.step(Command(loads={"weight": 2.0})).positions for simulation in (first, second)]
    assert np.array_equal(*lifted)
    assert third.step().converged


def test_a_factor_goes_with_its_last_body(made: list[int]) -> None:
    """A factor is deleted with its last body, and the next equal body makes a new one."""
    simulation = simulate(SCENE)
    del simulation
    gc.collect()
    simulate(SCENE)
    assert len(made) == 2


def test_another_matrix_has_another_factor() -> None:
    """A matrix that differs in the last bit of one entry has its own factor; each factor solves its own matrix."""
    random = np.random.default_rng(0)
    root = random.standard_normal((30, 30))
    matrix, points = constant_matrix.sparse.csc_matrix(root @ root.T + np.eye(30)), random.standard_normal((30, 3))
    other = matrix.copy()
    other[0, 0] = np.nextafter(matrix[0, 0], np.inf)
    assert factor_of(matrix, points) is not factor_of(other, points)
    kept, right = factor_of(matrix, points), random.standard_normal((30, 3))
    assert factor_of(matrix.copy(), points) is kept
    out = np.empty_like(right)
    kept.solve(right, out)
    np.testing.assert_allclose(matrix @ out, right, atol=1e-9)
