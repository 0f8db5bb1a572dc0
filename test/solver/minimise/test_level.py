# SPDX-License-Identifier: Apache-2.0
"""The stored tangent: it is the gradient's derivative, its factor solves, and an unusable tangent is replaced."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros import Simulation
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.matrix.tangent_assembly import Tangent
from gdfe_ros.solver.minimise.curvature import TangentProducts
from gdfe_ros.solver.minimise.level import TangentLevel
from test.solver.whole_tangent import whole_tangent
from test.written import scene_of

SCENE = """
mesh: {bar: {size: [0.1, 0.01, 0.01], cells: [10, 2, 2]}}
materials: {m: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}TIP}
loads: {weight: {gravity: [0, 0, -1.0]}}
"""
TIPS = {
    "clamped once": "",
    "a handle that slides": ", tip: {where: {face: x+}, free: [x, z]}",
    "a handle that slides and turns": ", tip: {where: {face: x+}, free: [x, z, ry]}",
}
Levels = tuple[TangentLevel, Tangent, TangentProducts, NDArray[np.float64]]


def _level(tip: str, stretch: float, *, power: int = 2) -> Levels:
    """Return a strip's tangent level, tangent, products and free components; ``power`` 1 is a uniform stretch."""
    simulation = Simulation(scene_of(SCENE.replace("TIP", tip)))
    equilibrium = simulation.stepper.equilibrium
    body = equilibrium.body
    state, share = equilibrium.at_rest(), (body.rest[:, 0] - body.rest[:, 0].min()) / 0.1
    moved = body.rest + np.outer(share**power * stretch * 0.1, [1.0, 0.0, 0.0])
    moved[body.unknowns.prescribed] = body.rest[body.unknowns.prescribed]
    task = Solve.at(equilibrium.model, state.with_(positions=moved)).evaluate()
    level, work = TangentLevel(body, equilibrium.matrix.assembled), task.active.workspace
    products = TangentProducts(body)
    products.begin(task)
    free = np.ones(body.unknowns.rows * 3)
    free[3 * len(body.unknowns.free) :] = _free_rows(body.unknowns)
    return level, level.factor_tangent(task.problem, work.u, work.x), products, free


def _free_rows(unknowns: tuple) -> NDArray[np.float64]:
    """Return 1 for each component of a rigid row that is free, and 0 for the others."""
    turns = [unknowns.turns[p] for p in range(len(unknowns.turns)) if unknowns.turn_row[p] >= 0]
    return np.concatenate([np.zeros(0), *unknowns.slides, *turns])


@pytest.mark.parametrize(
    ("tip", "stretch"), [*((tip, 0.0) for tip in TIPS.values()), ("", 0.1)], ids=[*TIPS, "a stretched shape"]
)
def test_it_is_the_derivative_of_the_gradient(tip: str, stretch: float) -> None:
    """The assembled tangent equals differences of the gradient, including rigid rows, at rest and stretched."""
    level, tangent, products, free = _level(tip, stretch)
    matrix, rng = whole_tangent(level, tangent), np.random.default_rng(0)
    assert tangent.shift == 0.0
    for _ in range(3):
        direction = rng.standard_normal(len(free)) * free
        exact = products(direction)
        np.testing.assert_allclose(free * (matrix @ direction), exact, atol=1e-5 * np.abs(exact).max())


@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS)
def test_its_factor_solves(tip: str) -> None:
    """Multiplying the factor's solution by the matrix gives the right-hand side."""
    level, tangent, _, free = _level(tip, 0.0)
    right = np.random.default_rng(1).standard_normal(len(free)) * free
    found = np.empty_like(right)
    level.solve(right, found)
    left = free * (whole_tangent(level, tangent) @ found) - right
    np.testing.assert_allclose(left, 0.0, atol=1e-2 * np.abs(right).max())  # the factor is kept in single precision


def test_an_indefinite_tangent_gets_a_factor_all_the_same() -> None:
    """The stored tangent of a strip squashed far beyond its buckling load is made positive definite."""
    level, tangent, *_ = _level("", -0.3, power=1)
    matrix = whole_tangent(level, tangent).toarray()
    assert np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0] > 0.0


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_a_tangent_that_is_not_finite_is_replaced(value: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tangent that overflows is replaced by the constant matrix, and its factor gives finite solutions."""
    level, tangent, *_ = _level("", 0.0)
    stiffness = np.full((40, 24, 24), value)
    monkeypatch.setattr(level, "_stiffen", lambda *_: stiffness)
    u, x = np.zeros(3 * level._unknowns.rows), level._body.rest
    with np.errstate(all="ignore"):
        taken = level.factor_tangent(
            SimpleNamespace(frame=None), u, x
        )  # what is not finite is known to be; 1e300 is tried
    assert np.array_equal(taken.blocks, level._constant)
    found = np.empty_like(u)
    level.solve(np.ones_like(u), found)
    assert np.isfinite(found).all()
    assert tangent.blocks.shape == taken.blocks.shape
