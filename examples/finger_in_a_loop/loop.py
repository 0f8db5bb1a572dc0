# SPDX-License-Identifier: Apache-2.0
"""Move the finger's tip to goals: measure the tip, compute tensions, command them, and again."""

import numpy as np

from gdfe_ros import Command
from gdfe_ros.examples.tip_tracker import TipTracker
from gdfe_ros.testing import Simulator

AXES = (1, 2)  # two tendons move the tip sideways: y and z
GOALS = [(0.004, -0.004), (0.006, -0.001), (0.002, -0.006)]  # displacement of the tip [m]

with Simulator("finger.yaml") as simulator:
    start = Command(actuators={"lower": 0.3, "left": 0.3})
    tip = np.array(simulator.step(start).probes["tip"].translation)
    rest = np.array([0.10, 0.0, 0.0])
    controller = TipTracker(
        simulator.jacobian()[0][list(AXES)], [0.3, 0.3], low=[0.0, 0.0], high=[3.0, 3.0], axes=AXES, gain=0.7
    )
    for y, z in GOALS:
        goal = rest + np.array([0.0, y, z])
        for _ in range(8):
            lower, left = controller.command(tip, goal)
            tip = np.array(simulator.step(Command(actuators={"lower": lower, "left": left})).probes["tip"].translation)
        error = np.linalg.norm((tip - goal)[list(AXES)])
        print(f"goal y, z = {y:g}, {z:g} m: error {1e3 * error:.3f} mm with {lower:.2f} N and {left:.2f} N")
        assert error < 2e-4
