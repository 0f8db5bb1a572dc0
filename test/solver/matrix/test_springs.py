# SPDX-License-Identifier: Apache-2.0
"""Springs in the stored tangent: commanded lengths and commanded volumes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.minimise.curvature import TangentProducts
from gdfe_ros.solver.minimise.level import TangentLevel
from test.solver.whole_tangent import whole_tangent
from test.written import STRIP, advance, scene_of


def pulled() -> Simulation:
    """Return a strip whose cable is shorter and whose chamber is larger than at rest."""
    simulation = Simulation(scene_of(STRIP))
    assert simulation.step(Command(actuators={"wire": 5e-4, "air": 1.05 * simulation.commands["air"]})).converged
    return simulation


def test_a_patch_that_changes_takes_few_iterations() -> None:
    """With closed notches, each step of a stronger pull takes few iterations."""
    simulation, iterations = Simulation(load_scene("tendon_finger", overrides={"self_contact": {}})), {}
    for tension in (3.0, 6.0, 9.0, 10.0, 11.0, 12.0, 13.0):
        result = advance(simulation, Command(actuators={"flexor": tension}))
        iterations[tension] = result.iterations
    assert max(iterations[tension] for tension in (10.0, 11.0, 12.0, 13.0)) < 18, iterations


@pytest.fixture
def drawn() -> SimpleNamespace:
    """Return the terms of such a strip, its tangent, and products with it."""
    simulation = pulled()
    equilibrium = simulation.stepper.equilibrium
    task = Solve.at(equilibrium.model, simulation.state).evaluate()
    level = TangentLevel(equilibrium.body, equilibrium.matrix.assembled, equilibrium.actuation.terms)
    products, work = TangentProducts(equilibrium.body), task.active.workspace
    products.begin(task)
    tangent = level.factor_tangent(task.problem, work.u, work.x)
    return SimpleNamespace(terms=equilibrium.actuation.terms, level=level, tangent=tangent, x=work.x, products=products)


def test_the_tangent_knows_commanded_lengths_and_volumes(drawn: SimpleNamespace) -> None:
    """The tangent equals differences of the gradient; without the springs of cable and chamber it does not."""
    matrix, apart = (
        whole_tangent(drawn.level, replace(drawn.tangent, springs=drawn.tangent.springs[:count])) for count in (2, 0)
    )
    assert len(drawn.tangent.springs) == 2
    direction = np.random.default_rng(0).standard_normal(matrix.shape[0])
    exact = drawn.products(direction)
    error, without = (np.abs(each @ direction - exact).max() for each in (matrix, apart))
    assert error < 0.02 * np.abs(exact).max()
    assert without > 5.0 * error


def test_a_gripper_in_motion_takes_few_iterations() -> None:
    """In steps of 5 ms, commanded lengths take at most six iterations a step; without springs they took twelve."""
    simulation = Simulation(load_scene("gripper", overrides={"dynamics": {"step": 0.005}}))
    results = [result for _, result in zip(range(40), simulation.play(800), strict=False)]
    assert all(result.converged for result in results)
    assert np.mean([result.iterations for result in results]) <= 6.0
