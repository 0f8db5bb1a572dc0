# SPDX-License-Identifier: Apache-2.0
"""A real node brings the swinging arm to a height: with the derivative term, and not without it."""

from __future__ import annotations

import pytest

from gdfe_ros.examples.tip_height import Gains, TipHeight
from gdfe_ros.simulation import Command
from gdfe_ros.testing import PublishedState, Simulator, tracking_error

GOAL, SETTLED = -0.015, 0.8
"""Goal height [m], and the time [s] by which the arm is there."""
STEPS = 100
"""Number of steps of 10 ms."""


def swing(gains: Gains) -> list[PublishedState]:
    """Release the arm under its weight with a controller in the loop; return the states."""
    controller = TipHeight(GOAL, gains=gains)

    def control(state: PublishedState) -> Command:
        return Command(actuators=controller.command(state.time, state.probes["tip"].translation[2]))

    with Simulator("swinging_arm", overrides={"dynamics.step": 0.01}, parameters={"dt": 0.01}) as simulator:
        return simulator.run(control, steps=STEPS)


@pytest.mark.parametrize(("derivative", "near", "far"), [(Gains.derivative, 0.0, 0.005), (0.0, 0.015, 0.1)])
def test_the_derivative_term_takes_the_swing_out(derivative: float, near: float, far: float) -> None:
    """With the derivative term the arm is at the height after a second; without it the arm still swings."""
    states = swing(Gains(derivative=derivative))
    assert all(state.record.converged for state in states)
    late = [(0.0, 0.0, state.probes["tip"].translation[2]) for state in states if state.time > SETTLED]
    assert near <= tracking_error(late, (0.0, 0.0, GOAL)).largest < far


def test_the_integral_stands_still_at_a_limit() -> None:
    """With a tip that stays too low, the pressure stays in its range, and falls as soon as the tip is high."""
    controller = TipHeight(0.01, gains=Gains(proportional=0.0, derivative=0.0), most=2e3)
    pressures = [controller.command(0.01 * step, -0.01) for step in range(200)]
    assert max(each["left"] for each in pressures) <= 2e3
    assert controller.command(2.0, 0.02)["left"] < pressures[-1]["left"]
    assert pressures[-1]["upper"] == 0.0


def test_the_other_side_lowers() -> None:
    """For a lower goal the chamber above gets the pressure, and a clock set back restarts the controller."""
    controller = TipHeight(-0.01)
    first = controller.command(1.0, 0.0)
    assert first == {"left": 0.0, "right": 0.0, "upper": pytest.approx(1e3)}
    assert controller.command(1.1, 0.0)["upper"] == pytest.approx(4e3)
    assert controller.command(0.0, 0.0) == first
