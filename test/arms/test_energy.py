# SPDX-License-Identifier: Apache-2.0
"""The work of an arm's motors equals the energy of its links plus the work on its load."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Command, Simulation, load_scene
from test.arms.held_box import Account, measure
from test.written import advance


def test_the_work_of_the_motors_is_accounted_for(held_block: Path) -> None:
    """In a smooth lift of a soft block, the motors' work is links' energy plus work on the block, within 0.3 %.

    Work is summed by the trapezoidal rule over steps of 5 ms, and velocities are averages over a step.
    """
    simulation = Simulation(load_scene(held_block, overrides={"dynamics": {"scheme": "bdf2", "step": 0.005}}))
    account, step, seconds = Account(simulation), 0.005, 1.5
    for k in range(round(seconds / step) + 1):
        share = k * step / seconds
        smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        result = advance(simulation, Command(joints={"lift": np.pi / 2 - smooth, "bend": 0.5 * smooth}), dt=step)
        account.add(result)
    assert account.net > 1.0
    assert account.net == pytest.approx(account.gained + account.hand, rel=3e-3)
    # The block's own account: what the handle gave it is kinetic, elastic and potential energy, or dissipated.
    assert result.energies["work"] == pytest.approx(account.hand, rel=1e-3)


@pytest.mark.slow
def test_arm_grasp_keeps_what_is_promised() -> None:
    """With every step solved, arm_grasp holds the box without drift, with the efforts of the weights."""
    found = measure({"solver.skip": []})
    assert found["converged"]
    assert found["drift"] < 1e-7
    assert found["effort error"] < 0.01
    assert found["balance"] < 0.01
