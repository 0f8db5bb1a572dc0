# SPDX-License-Identifier: Apache-2.0
"""Commands for given positions: circles, bounds, rates, weights, goals out of reach."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.control import InverseControl, Target
from gdfe_ros.control.limits import least_squares
from gdfe_ros.control.stack import Stack
from gdfe_ros.errors import CommandError, DependencyError, GdfeError

TIP = Target(probe="tip", axes=(0, 2))
MIDDLE = {"flexor": 5.0, "extensor": 15.0}
RADIUS = 5e-4
"""Radius [m] of a circle that both tendons reach; across its path the tip moves by only 0.1 mm per newton."""


def finger() -> Simulation:
    """Return the tendon finger with both tendons pulled."""
    simulation = Simulation(load_scene("tendon_finger", overrides={"solver.tolerance": 1e-6}))
    assert simulation.step(Command(actuators=MIDDLE)).converged
    return simulation


def test_a_fingertip_follows_a_circle() -> None:
    """Tensions found for a circle, applied in a simulation, lead the tip within 1 % of the radius."""
    control, model = InverseControl(finger(), [TIP]), finger()
    middle, errors = model.probe_positions()["tip"], []
    for angle in np.linspace(0.0, 2.0 * np.pi, 13):
        goal = middle + RADIUS * np.array([np.cos(angle), 0.0, np.sin(angle)])
        found = control.reach([goal])
        assert found.reached, found.message
        assert model.step(Command(actuators=found.commands)).converged
        errors.append(np.linalg.norm((model.probe_positions()["tip"] - goal)[[0, 2]]))
    assert np.mean(errors) < 0.01 * RADIUS


def test_goals_out_of_reach_end_at_the_nearest_point() -> None:
    """For a point out of reach, no other command comes nearer, and the message says so."""
    simulation, goal = finger(), np.array([0.2, 0.0, 0.0])
    found = InverseControl(simulation, [TIP]).reach([goal])
    assert not found.reached
    assert "nearest point so far, from the goal: tip 0.0998 m; at the end of their range: flexor" in found.message
    assert found.commands["flexor"] == 0.0
    here = simulation.snapshot()
    for change in ({"flexor": 0.05}, {"extensor": 0.1}, {"extensor": -0.1}):
        simulation.restore(here)
        simulation.step(Command(actuators={name: found.commands[name] + by for name, by in change.items()}))
        away = np.linalg.norm((simulation.probe_positions()["tip"] - goal)[[0, 2]])
        assert away > found.distances[0] - 1e-6


def test_a_move_keeps_to_rates() -> None:
    """With a rate limit, one move of 10 ms changes a tension by at most the limit, toward the goal."""
    scene = load_scene("tendon_finger", overrides={"actuators.flexor.cable.rate": 10.0})
    simulation = Simulation(scene)
    simulation.step(Command(actuators={"flexor": 1.0}), dt=1.0)
    before = simulation.probe_positions()["tip"]
    goal = before - np.array([0.02, 0.0, 0.01])
    found = InverseControl(simulation, [TIP], actuators=["flexor"]).move([goal], 0.01)
    assert found.commands["flexor"] == pytest.approx(1.1, rel=1e-12)
    assert not found.reached
    assert found.distances[0] < np.linalg.norm((goal - before)[[0, 2]])


def test_reaching_takes_the_time_that_rates_want() -> None:
    """With rate limits, the goal is reached in at least the simulation time that the changes of command need."""
    rates = {f"actuators.{name}.cable.rate": 10.0 for name in MIDDLE}
    simulation = Simulation(load_scene("tendon_finger", overrides=rates))
    simulation.step(Command(actuators=MIDDLE), dt=10.0)
    before, goal = simulation.time, simulation.probe_positions()["tip"] + np.array([0.0, 0.0, 2e-3])
    found = InverseControl(simulation, [Target(probe="tip", axes=(2,))]).reach([goal])
    assert found.reached, found.message
    assert simulation.time - before >= max(abs(found.commands[name] - MIDDLE[name]) for name in MIDDLE) / 10.0


def test_priorities_decide_between_targets() -> None:
    """Two targets for one tip lead to their mean, weighted by their weights."""
    middle, away = finger().probe_positions()["tip"], np.array([3e-4, 0.0, 0.0])
    for weight, share in ((1.0, 0.5), (3.0, 0.25)):
        simulation = finger()
        targets = [Target(probe="tip", axes=(0, 2), weight=weight), TIP]
        InverseControl(simulation, targets).reach([middle, middle + away])
        moved = simulation.probe_positions()["tip"] - middle
        np.testing.assert_allclose(moved[[0, 2]], share * away[[0, 2]], atol=2e-6)


def test_a_state_without_derivative_ends_nothing_halfway() -> None:
    """A body without a converged state raises an error with the reason, and its commands and shape stay."""
    simulation = finger()
    control, goal = InverseControl(simulation, [TIP]), simulation.probe_positions()["tip"] + np.array([0, 0, 1e-3])
    stuck = Simulation(load_scene("tendon_finger", overrides={"solver.max_iterations": 2}))
    stuck.step(Command(actuators=MIDDLE))
    for made in (
        lambda: InverseControl(stuck, [TIP]).reach([goal]),
        lambda: InverseControl(stuck, [TIP]).move([goal], 0.1),
    ):
        before = stuck.positions.copy()
        with pytest.raises(GdfeError, match="no derivative: the state is no equilibrium"):
            made()
        np.testing.assert_array_equal(stuck.positions, before)
        assert stuck.commands["flexor"] == MIDDLE["flexor"]
    assert control.reach([goal]).reached


def test_a_search_that_meets_a_state_without_derivative_keeps_its_best_point(monkeypatch: pytest.MonkeyPatch) -> None:
    """If only a later state of the search has no derivative, the search ends there, nearer to the goal, and says so."""
    simulation = finger()
    control, goal = InverseControl(simulation, [TIP]), simulation.probe_positions()["tip"] + np.array([0, 0, 0.02])
    before, exact, calls = np.linalg.norm([0, 0, 0.02]), Stack.jacobian, []

    def jacobian(stack: Stack, actuators: tuple[str, ...]) -> np.ndarray:
        calls.append(actuators)
        if len(calls) > 1:
            raise GdfeError("no derivative: the equilibrium is unstable")
        return exact(stack, actuators)

    monkeypatch.setattr(Stack, "jacobian", jacobian)
    found = control.reach([goal])
    assert len(calls) == 2
    assert not found.reached
    assert found.distances[0] < before
    assert found.message.endswith("no derivative: the equilibrium is unstable")
    assert simulation.result.converged


def test_commands_without_effect_are_named() -> None:
    """Neither tendon bends the finger sideways: the derivative is zero, and the message says so."""
    simulation = finger()
    control = InverseControl(simulation, [Target(probe="tip", axes=(1,))])
    goal = simulation.probe_positions()["tip"] + np.array([0.0, 1e-3, 0.0])
    for found in (control.reach([goal]), control.move([goal], 0.1)):
        assert not found.reached
        assert "zero derivative at their commands: flexor, extensor; remedy: " in found.message


def test_wrong_input_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unknown names, invalid goals, a scene in motion and a solver that is not installed are refused."""
    simulation = Simulation(load_scene("tendon_finger"))
    with pytest.raises(CommandError, match="no probe 'nail'; probes: tip"):
        InverseControl(simulation, ["nail"])
    with pytest.raises(CommandError, match="no actuator 'muscle' in scene 'tendon_finger'; actuators: flexor"):
        InverseControl(simulation, ["tip"], actuators=["muscle"])
    with pytest.raises(CommandError, match="actuators named twice: flexor, flexor"):
        InverseControl(simulation, ["tip"], actuators=["flexor", "flexor"])
    for axes in ((3,), (2.0,), (2, 2)):
        with pytest.raises(ValueError, match="axes of target 'tip' must be some of 0, 1, 2, each once, got"):
            Target(probe="tip", axes=axes)
    with pytest.raises(CommandError, match="remedy: a scene without dynamics"):
        InverseControl(Simulation(load_scene("silicone_beam")), ["tip"])
    with pytest.raises(CommandError, match=r"goals must be finite and of shape \(1, 3\)"):
        InverseControl(simulation, ["tip"]).reach([[0.0, np.nan, 0.0]])
    monkeypatch.setitem(sys.modules, "quadprog", None)
    with pytest.raises(DependencyError, match=r"remedy: pip install gdfe_ros\[control\]"):
        least_squares(np.eye(2), np.ones(2), -np.ones(2), np.ones(2), least=1e-4)


def test_a_solution_is_at_a_bound_to_the_last_bit_or_has_no_slope() -> None:
    """Each component of bounded least squares, the optimum of a convex problem, is at its bound or has no slope."""
    random, leaning = np.random.default_rng(0), 0
    for number in range(400):
        count = int(random.integers(1, 13 if number % 4 == 0 else 5))
        rows = random.standard_normal((6 if count > 4 else 3, count)) * 10.0 ** random.uniform(-6.0, 3.0, count)
        goal, least, lengths = random.standard_normal(len(rows)), 1e-4, np.linalg.norm(rows, axis=0)
        low, high = 10.0 ** random.uniform(-2.0, 1.0, (2, count)) / lengths * [[-1.0], [1.0]]
        if number % 2:
            low[0], high[-1] = -np.inf, np.inf
        found = least_squares(rows, goal, low, high, least=least)
        slope = (rows.T @ (rows @ found - goal)) / lengths + least**2 * lengths * found
        down, up = slope > 1e-9, slope < -1e-9
        assert ((low <= found) & (found <= high)).all()
        assert np.array_equal(found[down], low[down])
        assert np.array_equal(found[up], high[up])
        leaning += int((down | up).sum())
    assert leaning > 100
