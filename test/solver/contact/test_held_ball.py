# SPDX-License-Identifier: Apache-2.0
"""The published force on a ball that three fingers lift at constant speed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.results.step_result import StepResult
from test.written import advance

SCENE = Path(__file__).parents[2] / "data" / "three_pneunets.yaml"
CLOSED, BEGINS = 0.8, 0.9
"""Times [s] at which the fingers are closed, and at which the lift begins."""
MASS, GRAVITY = 4.0 / 3.0 * np.pi * 0.026**3 * 300.0, 9.81


def lift_ball(scheme: str, step: float, until: float) -> Iterator[tuple[float, StepResult, Simulation]]:
    """Close the fingers on the ball and lift it; yield the time of each step [s], its result, and the simulation."""
    given = {"dynamics.step": step, "dynamics.scheme": scheme}
    simulation = Simulation(load_scene(str(SCENE), overrides=given))
    for time in np.arange(step, until + 0.5 * step, step):
        pressure = 25e3 * min(time / CLOSED, 1.0)
        lifted = 0.05 * max(time - BEGINS, 0.0) / 0.6
        command = Command(
            handles={"palm": Pose(translation=(0.0, 0.0, lifted))},
            actuators=dict.fromkeys(("front", "left", "right"), pressure),
        )
        yield time, advance(simulation, command, dt=step), simulation


@pytest.mark.parametrize(
    ("scheme", "step"),
    [("bdf2", 0.005), ("bdf2", 0.01), ("bdf2", 0.02), ("generalised_alpha", 0.01), ("newmark", 0.01)],
)
def test_the_force_on_a_lifted_ball_is_its_weight(scheme: str, step: float) -> None:
    """The mean force is the weight to 1 %, no step is without contact, and every step converges."""
    forces = [result.reactions["ball"][2] for time, result, _ in lift_ball(scheme, step, 1.4) if time > 0.999]
    assert np.mean(forces) == pytest.approx(-MASS * GRAVITY, rel=0.01)  # of the ball on the fingers
    assert np.abs(forces).min() > 1e-9


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha", "newmark"])
def test_the_force_on_a_ball_is_its_change_of_momentum(scheme: str) -> None:
    """In each long step, the published impulse on the lifted ball is its change of momentum, to the solve accuracy."""
    step, before = 0.02, 0.0
    for time, result, simulation in lift_ball(scheme, step, 1.1):
        speed = simulation.stepper.velocities(simulation.state)[-4:, 2].mean()  # of the ball's four vertices
        if time > BEGINS:
            change = MASS * (speed - before + GRAVITY * step)
            assert -result.reactions["ball"][2] * step == pytest.approx(change, abs=1e-4 * MASS * GRAVITY * step)
        before = speed
