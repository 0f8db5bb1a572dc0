# SPDX-License-Identifier: Apache-2.0
"""Springs in the stored tangent: touching parts, commanded lengths and commanded volumes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.scene import scene_from_text
from gdfe_ros.solver.descent.products import TangentProducts
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.tangent.level import TangentLevel
from gdfe_ros.solver.tangent.springs import Springs
from gdfe_ros.solver.terms.cable import TARGET

STRIP = """
name: strip
mesh:
  bar:
    size: [0.1, 0.02, 0.02]
    cells: [10, 4, 4]
    cut: [{box: {x: [0.01, 0.09], y: [-0.005, 0.005], z: [-0.005, 0.005]}}]
materials: {m: {law: neo_hookean, young: 1.0e6, poisson: 0.45}}
regions: [{material: m}]
handles: {base: {where: {face: x-}, fixed: true}}
actuators:
  wire: {cable: {points: [[0, 0, 0.008], [0.05, 0, 0.008], [0.1, 0, 0.008]], command: shortening}}
  air: {chamber: {near: [0.05, 0, 0], command: volume}}
"""


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
    level, work = equilibrium.minimiser.level, task.active.workspace
    products = TangentProducts(equilibrium.body)
    products.begin(task)
    return SimpleNamespace(level=level, tangent=level.take(task.problem, work.u, work.x), products=products)


def test_the_tangent_couples_what_touches(notches: SimpleNamespace) -> None:
    """The tangent of a finger whose links touch equals differences of the gradient."""
    level, tangent = notches.level, notches.tangent
    none = Springs.none()
    apart = level.assembled(replace(tangent, **none._asdict()))
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
    np.testing.assert_allclose(notches.level.assembled(notches.tangent) @ found, right, atol=1e-3 * np.abs(right).max())


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


@pytest.fixture
def drawn() -> SimpleNamespace:
    """Return a strip whose cable is shorter and whose chamber is larger than at rest, with its tangent and products."""
    simulation = Simulation(scene_from_text(STRIP))
    wide = 1.05 * simulation.commands["air"]
    assert simulation.step(Command(actuators={"wire": 5e-4, "air": wide})).converged
    equilibrium = simulation.stepper.equilibrium
    task = Solve.at(equilibrium.model, simulation.state).evaluate(
        equilibrium.whole, equilibrium.matrix.coupling, threads=None
    )
    level = TangentLevel(equilibrium.body, equilibrium.matrix.assembled, equilibrium.actuation.terms)
    products, work = TangentProducts(equilibrium.body), task.active.workspace
    products.begin(task)
    tangent = level.take(task.problem, work.u, work.x)
    return SimpleNamespace(terms=equilibrium.actuation.terms, level=level, tangent=tangent, x=work.x, products=products)


def test_the_tangent_knows_commanded_lengths_and_volumes(drawn: SimpleNamespace) -> None:
    """The tangent equals differences of the gradient; without the springs of cable and chamber it does not."""
    matrix, apart = (
        drawn.level.assembled(replace(drawn.tangent, **springs._asdict()))
        for springs in (drawn.tangent.springs, Springs.none())
    )
    assert drawn.tangent.springs.count == 2
    direction = np.random.default_rng(0).standard_normal(matrix.shape[0])
    exact = drawn.products(direction)
    error, without = (np.abs(each @ direction - exact).max() for each in (matrix, apart))
    assert error < 0.02 * np.abs(exact).max()
    assert without > 5.0 * error


def test_a_cable_becomes_slack_without_a_new_factor(drawn: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the cable is slack, its spring leaves the tangent; the factor stays, and solves the other matrix."""
    level, wire = drawn.level, next(term for term in drawn.terms if term.name == "wire")
    monkeypatch.setattr(level, "_load", lambda _: pytest.fail("the tangent is factored anew"))
    level.turn(drawn.x)
    assert level.reconnected(drawn.tangent, drawn.x) is drawn.tangent
    wire.hold(np.zeros(1))
    wire.reals[TARGET] *= 2.0
    slack = level.reconnected(drawn.tangent, drawn.x)
    assert slack.springs.count == 1
    right = np.random.default_rng(0).standard_normal(level.assembled(slack).shape[0])
    found = np.empty_like(right)
    level.solve(right, found)
    np.testing.assert_allclose(level.assembled(slack) @ found, right, atol=1e-4 * np.abs(right).max())
    level.load(drawn.tangent)
    level.solve(right, found)
    np.testing.assert_allclose(level.assembled(drawn.tangent) @ found, right, atol=1e-4 * np.abs(right).max())


def test_a_gripper_in_motion_takes_few_iterations() -> None:
    """In steps of 5 ms, commanded lengths take at most six iterations a step; without springs they took twelve."""
    simulation = Simulation(load_scene("gripper", overrides={"dynamics": {"step": 0.005}}))
    results = [result for _, result in zip(range(40), simulation.play(800), strict=False)]
    assert all(result.converged for result in results)
    assert np.mean([result.iterations for result in results]) <= 6.0
