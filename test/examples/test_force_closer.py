# SPDX-License-Identifier: Apache-2.0
"""A finger presses on a plate with a commanded force, in closed loop with the real node."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.constraints import Pose
from gdfe_ros.examples.force_closer import ForceCloser
from gdfe_ros.simulation import Command
from gdfe_ros.testing import PublishedState, Simulator

GOAL = 0.3
PRESS = {
    "obstacles": {"plate": {"plane": [0, 0, 1], "at": [0, 0, -0.03], "friction": 0.3}},
    "sensors": {"tip": {"where": {"face": "x+"}}},
}
AWAY = Pose((0.0, 0.0, -0.005))


def _force(state: PublishedState) -> float:
    return float(np.linalg.norm(state.sensors["tip"][:3]))


def test_the_finger_presses_with_the_force_it_is_told() -> None:
    """The finger presses with 0.3 N, and does so again after the plate is drawn back."""
    closer = ForceCloser(GOAL, 0.5, low=0.0, high=20.0)
    with Simulator("tendon_finger", overrides=PRESS) as simulator:

        def controller(state: PublishedState) -> Command:
            return Command(actuators={"flexor": closer.command(_force(state), state.joints["flexor"][2])})

        before = simulator.run(controller, steps=10)
        simulator.step(Command(handles={"plate": AWAY}))
        assert _force(simulator.state) < 0.9 * GOAL
        after = simulator.run(controller, steps=8)
    assert _force(before[0]) == 0.0
    for state in (before[-1], after[-1]):
        assert _force(state) == pytest.approx(GOAL, rel=0.02)
        np.testing.assert_allclose(state.sensors["tip"][:3], state.wrenches["plate"][:3], atol=1e-9)
    assert after[-1].joints["flexor"][2] > before[-1].joints["flexor"][2]
    assert max(map(_force, (*before, *after))) < 1.3 * GOAL


@pytest.mark.parametrize("stiffness", [0.1, 10.0, -10.0])
def test_any_stiffness_is_found(stiffness: float) -> None:
    """A spring of any stiffness and either direction is gripped with the goal force, with limited overshoot."""
    closer, command, forces = ForceCloser(1.0, np.copysign(0.05, stiffness)), 0.0, []
    for _ in range(500):
        forces.append(max(0.0, stiffness * command - 1.0))
        command = closer.command(forces[-1], command)
    assert forces[-1] == pytest.approx(1.0, rel=1e-3)
    assert max(forces) <= 1.0 + 0.05 * abs(stiffness)


def test_what_cannot_be_reached_ends_at_the_limit() -> None:
    """Without contact the command stops at its limit; a goal of zero is refused."""
    closer, command = ForceCloser(1.0, 0.3, high=1.0), 0.0
    for _ in range(10):
        command = closer.command(0.0, command)
    assert command == 1.0
    with pytest.raises(ValueError, match="goal 0"):
        ForceCloser(0.0, 0.3)
