# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of a body that sticks to or slips on an obstacle, against differences of steps from that state."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from test.written import advance, scene_of

BAR = """
mesh: {bar: {size: [0.1, 0.03, 0.03], cells: [8, 3, 3]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1100}}
handles: {base: {where: {face: x-}}}
obstacles: {ball: {sphere: {radius: 0.03}, at: [0.07, 0.004, -0.040], friction: 2.0}}
loads: {weight: {gravity: [0, 0, -9.81]}, push: {surface: {where: {face: x+}, force: [0, 0.05, 0]}}}
probes: {tip: [0.1, 0, 0], edge: [0.1, 0.015, 0.015]}
solver: {tolerance: 1.0e-10, max_iterations: 100000}
"""
NEAR = 1e-4


def pressed(friction: float, pushes: list[float]) -> Simulation:
    """Press the ball into the bar, and push the bar sideways in steps."""
    simulation = Simulation(scene_of(BAR, overrides={"obstacles.ball.friction": friction}))
    assert simulation.step(Command({"ball": Pose((0.0, 0.0, 0.006))}, loads={"push": 0.5})).converged
    for push in pushes:
        assert simulation.step(Command({"ball": Pose((0.0, 0.0, 0.0055))}, loads={"push": push})).converged
    return simulation


def seen(simulation: Simulation) -> np.ndarray:
    """Return the probes (6,) [m]."""
    return np.concatenate([*simulation.probe_positions().values()])


@pytest.mark.parametrize(("name", "step"), [("loads.push", 1e-3), ("obstacles.ball.z", 1e-6)])
def test_a_body_that_sticks(name: str, step: float) -> None:
    """With sticking points, derivatives by the push and by the ball's height equal central differences."""
    simulation = pressed(2.0, [0.4])
    assert not simulation.result.contacts["ball"].slips.any()
    exact = simulation.sensitivities(None, [name]).matrix[:, 0]
    here, sides = simulation.snapshot(), []
    for change in (step, -step):
        simulation.restore(here)
        raised = Pose((0.0, 0.0, 0.0055 + change * (name == "obstacles.ball.z")))
        result = simulation.step(Command({"ball": raised}, loads={"push": 0.4 + change * (name == "loads.push")}))
        assert not result.contacts["ball"].slips.any()
        sides.append(seen(simulation))
    difference = (sides[0] - sides[1]) / (2.0 * step)
    np.testing.assert_allclose(exact, difference, rtol=0, atol=NEAR * np.abs(difference).max())


def test_a_body_that_slips() -> None:
    """With slipping points, the derivative by the push in the direction of slip equals one-sided differences."""
    simulation = pressed(0.1, [3.0, 3.5, 4.0])
    assert simulation.result.contacts["ball"].slips.all()
    exact = simulation.sensitivities(None, ["loads.push"]).matrix[:, 0]
    here, began, slopes = simulation.snapshot(), seen(simulation), []
    for step in (1e-3, 2e-3):
        simulation.restore(here)
        assert simulation.step(Command(loads={"push": 4.0 + step})).converged
        slopes.append((seen(simulation) - began) / step)
    difference = 2.0 * slopes[0] - slopes[1]
    np.testing.assert_allclose(exact, difference, rtol=0, atol=NEAR * np.abs(difference).max())


CUBE = """
mesh: {bar: {size: [0.02, 0.02, 0.02], cells: [2, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 3.0e5, poisson: 0.4}}
handles: {top: {where: {face: z+}, fixed: true}}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.012]}}
probes: {foot: [0.01, 0, -0.01]}
solver: {tolerance: 1.0e-9, max_iterations: 100000}
"""


def test_a_body_that_hardly_touches() -> None:
    """Vertices pressed by a micrometre into a plane move with the plane, although they are close to separation."""
    simulation = Simulation(scene_of(CUBE))
    assert simulation.step(Command({"floor": Pose((0.0, 0.0, 0.002 + 1e-6))})).converged
    exact = simulation.sensitivities(["probes.foot"], ["obstacles.floor.z"]).matrix[:, 0]
    assert exact[2] == pytest.approx(1.0, abs=1e-4)


def test_a_light_touch_converges_at_a_tight_tolerance() -> None:
    """Forces of a micrometre's overlap converge at a tolerance of 1e-9, whatever the rounding (11 of 40 did not)."""
    for depth in 1e-6 * np.linspace(1.0, 1.04, 20):
        result = advance(Simulation(scene_of(CUBE)), Command({"floor": Pose((0.0, 0.0, 0.002 + depth))}))
        assert result.iterations < 500
