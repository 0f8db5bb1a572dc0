# SPDX-License-Identifier: Apache-2.0
"""Every feature with operations that take another path: the same equilibrium within tolerances, exact derivatives."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Simulation
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.solver.settings import Policy

NEAR = 30.0
"""Largest distance between the ends of two paths to one equilibrium, in tolerances."""
ENERGIES = 0.01
"""Largest relative difference between their energies."""


def assert_near(lab: Any, simulation: Simulation, found: StepResult, expected: StepResult) -> None:
    """Require two equilibria of one command to agree within `NEAR` and `ENERGIES`."""
    off = lab.distance(found.positions, expected.positions, simulation.mesh)
    assert off < NEAR * simulation.settings.tolerance
    assert found.energy == pytest.approx(expected.energy, rel=ENERGIES)


def test_positions_of_another_simulation(feature: Any, lab: Any, differences: Any) -> None:
    """A start from another simulation's final positions gives the same equilibrium, and the same bits when repeated."""
    found = []
    for _ in range(2):
        simulation = feature.simulation()
        feature.run(simulation, feature.elsewhere)
        simulation.set_positions(feature.results[-1].positions)
        found.append(feature.finish(simulation))
    assert not differences.result(found[1], found[0])
    if simulation.policy is Policy.ENERGY:
        assert_near(lab, simulation, found[0], feature.results[-1])


def test_restart_from_mirrored_positions(feature: Any, lab: Any, differences: Any) -> None:
    """From mirrored positions a step reaches the same equilibrium, and after a reset the same bits."""
    simulation, plain = feature.simulation(), feature.simulation()
    centre = simulation.mesh.vertices.mean(axis=0)
    feature.run(simulation, feature.elsewhere)
    simulation.set_positions((simulation.mesh.vertices - centre) * (1.0, 1.0, -1.0) + centre)
    found, expected = feature.finish(simulation), feature.finish(plain)
    assert_near(lab, simulation, found, expected)
    if found.restarts:
        np.testing.assert_array_equal(found.positions, expected.positions)
        assert found.energy == expected.energy
    simulation.reset()
    assert not differences.run(feature.run(simulation, feature.way), feature.results)


def test_after_a_failed_step(feature: Any, lab: Any, differences: Any) -> None:
    """After a failed step, positions are finite, the equilibrium is found, and a reset gives the same bits."""
    simulation = feature.simulation()
    feature.run(simulation, feature.way[:1])
    failed = simulation.step(feature.absurd, cut_after=40)
    assert np.isfinite(failed.positions).all()
    if simulation.policy is Policy.ENERGY:
        assert_near(lab, simulation, feature.finish(simulation), feature.finish(feature.simulation()))
    simulation.reset()
    assert not differences.run(feature.run(simulation, feature.way), feature.results)


def test_jacobian(feature: Any, lab: Any, differences: Any) -> None:
    """d(probe)/d(command) equals differences of fresh simulations, and computing it leaves later steps unchanged."""
    simulation, twin = feature.simulation(), feature.simulation()
    for each in (simulation, twin):
        feature.run(each, feature.way)
    name, change = feature.lever
    column = simulation.jacobian(["edge"], [name])[0, :, 0]
    assert not differences.state(simulation, twin)
    assert not differences.run(*(feature.run(each, feature.elsewhere) for each in (simulation, twin)))
    before = [] if simulation.policy is Policy.ENERGY else [command for command, _ in feature.way]
    ends = []
    for side in (-change, change):
        near = {**feature.end.actuators, name: feature.end.actuators[name] + side}
        end = lab.fresh(simulation, *before, replace(feature.end, actuators=near), tolerance=1e-8)
        ends.append(end.probe_positions()["edge"])
    slope = (ends[1] - ends[0]) / (2.0 * change)
    np.testing.assert_allclose(column, slope, atol=0.01 * np.abs(slope).max())
