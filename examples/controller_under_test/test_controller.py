# SPDX-License-Identifier: Apache-2.0
"""The controller reaches its goal without overshoot; with too high a gain, the same test would fail."""

import pytest
from controller import TipHeight

from gdfe_ros import Command
from gdfe_ros.testing import Simulator

GOAL = -0.004  # m


@pytest.fixture(scope="module")
def simulator():
    """Give the real node with the finger, in lockstep; each test starts from the undeformed finger."""
    with Simulator("finger.yaml") as simulator:
        yield simulator


@pytest.mark.parametrize(("gain", "settles"), [(60.0, True), (2000.0, False)])
def test_the_tip_reaches_its_height(simulator, gain, settles):
    """Within 25 steps the tip stays within 0.1 mm of its height."""
    controller = TipHeight(GOAL, gain)
    state, heights = simulator.step(Command(actuators={"lower": 0.0, "left": 0.0})), []
    for _ in range(25):
        tension = min(controller.tension(state.probes["tip"].translation[2]), 3.0)
        state = simulator.step(Command(actuators={"lower": tension}))
        heights.append(state.probes["tip"].translation[2])
    assert all(abs(height - GOAL) < 1e-4 for height in heights[-5:]) is settles
