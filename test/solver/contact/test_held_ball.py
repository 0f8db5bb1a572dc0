# SPDX-License-Identifier: Apache-2.0
"""The published force on a ball that three fingers lift at constant speed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation, load_scene
from test.written import advance

SCENE = Path(__file__).parents[2] / "data" / "three_pneunets.yaml"
CLOSED, BEGINS, ENDS = 0.8, 0.9, 1.4
"""Times [s] at which the fingers are closed, and at which the lift begins and this test ends."""


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha"])
def test_the_force_on_a_lifted_ball_is_its_weight(scheme: str) -> None:
    """With steps of 10 ms the mean force is the weight to 1 %, no step is without contact, and every step converges."""
    given = {"dynamics.step": 0.01, "dynamics.scheme": scheme}
    simulation, forces = Simulation(load_scene(str(SCENE), overrides=given)), []
    weight = 4.0 / 3.0 * np.pi * 0.026**3 * 300.0 * 9.81
    for time in np.arange(0.01, ENDS + 0.005, 0.01):
        pressure = 25e3 * min(time / CLOSED, 1.0)
        lifted = 0.05 * max(time - BEGINS, 0.0) / 0.6
        command = Command(
            handles={"palm": Pose(translation=(0.0, 0.0, lifted))},
            actuators=dict.fromkeys(("front", "left", "right"), pressure),
        )
        result = advance(simulation, command, dt=0.01)
        if time > 0.999:
            forces.append(result.reactions["ball"][2])
    assert np.mean(forces) == pytest.approx(-weight, rel=0.01)  # of the ball on the fingers
    assert np.abs(forces).min() > 1e-9
