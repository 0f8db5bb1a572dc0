# SPDX-License-Identifier: Apache-2.0
"""Contact springs between touching parts, in the stored tangent."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.solver.descent.products import TangentProducts
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.tangent.springs import Springs


def closed() -> Simulation:
    """Return a finger whose notches have closed."""
    simulation = Simulation(load_scene("tendon_finger", overrides={"self_contact": {}}))
    for tension in (3.0, 6.0, 9.0):
        assert simulation.step(Command(actuators={"flexor": tension})).converged
    return simulation


@pytest.fixture(scope="module")
def notches() -> SimpleNamespace:
    """Return the tangent of such a finger, and products with the present tangent."""
    simulation = closed()
    equilibrium = simulation.stepper.equilibrium
    task = Solve.at(equilibrium._model, simulation.state).evaluate(
        equilibrium._whole, equilibrium.matrix.coupling, threads=None
    )
    level, work = equilibrium._model.level, task.active.workspace
    products = TangentProducts(equilibrium.body)
    products.begin(task)
    return SimpleNamespace(level=level, tangent=level.take(task.problem, work.u, work.x), products=products)


def test_the_tangent_couples_what_touches(notches: SimpleNamespace) -> None:
    """The tangent of a finger whose links touch equals differences of the gradient."""
    level, tangent = notches.level, notches.tangent
    none = Springs.none()
    apart = level.assembled(replace(tangent, ends=none.ends, ways=none.ways))
    matrix, rng = level.assembled(tangent), np.random.default_rng(0)
    assert len(tangent.ends) > 10
    for _ in range(3):
        direction = rng.standard_normal(matrix.shape[0])
        exact = notches.products(direction)
        scale = np.abs(exact).max()
        np.testing.assert_allclose(matrix @ direction, exact, atol=1e-3 * scale)
        assert np.abs(apart @ direction - exact).max() > 0.02 * scale


def test_its_factor_solves(notches: SimpleNamespace) -> None:
    """With contact springs, multiplying the factor's solution by the matrix gives the right-hand side."""
    right = np.random.default_rng(1).standard_normal(notches.level.assembled(notches.tangent).shape[0])
    found = np.empty_like(right)
    notches.level.load(notches.tangent)
    notches.level.solve(right, found)
    np.testing.assert_allclose(notches.level.assembled(notches.tangent) @ found, right, atol=1e-6)


def test_states_with_springs_are_saved_to_the_bit() -> None:
    """A finger with closed notches, saved and loaded into another simulation, continues with the same bits."""
    first, second = closed(), Simulation(load_scene("tendon_finger", overrides={"self_contact": {}}))
    load_state(second, save_state(first))
    assert len(second.state.tangent.ends) > 10
    found = [each.step(Command(actuators={"flexor": 11.0})) for each in (first, second)]
    assert found[0].iterations == found[1].iterations
    assert np.array_equal(found[0].positions, found[1].positions)


def test_a_patch_that_changes_takes_few_iterations() -> None:
    """With closed notches, each step of a stronger pull takes few iterations.

    Without the contact springs in the tangent, a step of one newton took 28 to 33 iterations.
    """
    simulation, iterations = closed(), {}
    for tension in (10.0, 11.0, 12.0, 13.0):
        iterations[tension] = simulation.step(Command(actuators={"flexor": tension})).iterations
    assert max(iterations.values()) < 18, iterations
