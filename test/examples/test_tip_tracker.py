# SPDX-License-Identifier: Apache-2.0
"""The tip of the three-chamber arm follows a circle, in closed loop with the real node."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.examples.tip_tracker import TipTracker, circle
from gdfe_ros.simulation import Command
from gdfe_ros.testing import Simulator, tracking_error

RADIUS = 0.005
STEPS = 100
"""Number of steps per round."""
AHEAD, WRONG = 50, 4
"""Number of steps with the right sign of the gain, then with the wrong sign: further ones find no equilibrium."""


@pytest.fixture(scope="module")
def paths() -> tuple[np.ndarray, np.ndarray]:
    """Return tips and goals (steps, 3) [m] on a circle, first with the right, then with the wrong sign of the gain."""
    tips, goals = [], []
    with Simulator("three_chamber_arm") as simulator:
        actuators = simulator.scene.actuators
        low, high = ([getattr(actuator, end) for actuator in actuators] for end in ("low", "high"))
        jacobian, command = simulator.jacobian()[0, 1:], np.zeros(len(actuators))
        state = simulator.state
        centre = np.array(state.probes["tip"].translation)
        centre[2] += RADIUS
        for step in range(AHEAD + WRONG):
            if step in (0, AHEAD):
                gain = -1.0 if step else 1.0
                tracker = TipTracker(jacobian, command, low=low, high=high, axes=(1, 2), gain=gain)
            goals.append(circle(centre, RADIUS, (step + 1) / STEPS))
            command = tracker.command(state.probes["tip"].translation, goals[-1])
            named = zip((actuator.name for actuator in actuators), command, strict=True)
            state = simulator.step(Command(actuators=dict(named)))
            tips.append(state.probes["tip"].translation)
    tips, goals = np.array(tips), np.array(goals)
    goals[:, 0] = tips[:, 0]
    return tips, goals


def test_the_tip_follows_a_circle_within_two_percent_of_its_radius(paths: tuple[np.ndarray, np.ndarray]) -> None:
    """Over half a round in 50 steps, the largest distance to the goal is below 2 % of the radius."""
    error = tracking_error(*(path[:AHEAD] for path in paths))
    assert error.largest < 0.02 * RADIUS, error


def test_the_wrong_sign_is_found_out(paths: tuple[np.ndarray, np.ndarray]) -> None:
    """With the wrong sign of the gain, the largest distance to the goal exceeds 20 % of the radius."""
    assert tracking_error(*(path[AHEAD:] for path in paths)).largest > 0.2 * RADIUS


def test_broyden_learns_a_wrong_jacobian() -> None:
    """With a Jacobian 1.5 times too large, the error on a linear plant vanishes after some steps."""
    plant = np.array([[2.0, 1.0], [0.5, 1.5]])
    tracker = TipTracker(1.5 * plant, [0.0, 0.0], low=[-9, -9], high=[9, 9], axes=(0, 1))
    tip = np.zeros(3)
    for step in range(12):
        command = tracker.command(tip, [1.0, np.sin(step), 0.0])
        tip = np.array([*(plant @ command), 0.0])
    assert tip[:2] == pytest.approx([1.0, np.sin(11)], abs=1e-4)


def test_commands_stay_in_range() -> None:
    """A command beyond the range stops at the limit."""
    tracker = TipTracker([[1.0]], [0.0], low=[0.0], high=[0.5], axes=(0,))
    assert tracker.command([0.0, 0, 0], [3.0, 0, 0]) == pytest.approx([0.5], abs=1e-9)
    assert tracker.command([0.5, 0, 0], [-3.0, 0, 0]) == pytest.approx([0.0], abs=1e-9)
