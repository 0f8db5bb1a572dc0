# SPDX-License-Identifier: Apache-2.0
"""The work of an arm's motors equals the energy of its links plus the work on its load."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Command, Simulation, load_scene
from test.arms.held_box import measure

GRAVITY = np.array([0.0, 0.0, -9.81])


def test_the_work_of_the_motors_is_accounted_for(held_block: Path) -> None:
    """In a smooth lift of a soft block, the motors' work is links' energy plus work on the block, within 0.3 %.

    Work is summed by the trapezoidal rule over steps of 5 ms, and velocities are averages over a step.
    """
    simulation = Simulation(load_scene(held_block, overrides={"dynamics": {"scheme": "bdf2", "step": 0.005}}))
    arm, step, seconds = simulation.scene.arms[0], 0.005, 1.5
    work, hand, last = 0.0, 0.0, None
    for k in range(round(seconds / step) + 1):
        share = k * step / seconds
        smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        result = simulation.step(Command(joints={"lift": np.pi / 2 - smooth, "bend": 0.5 * smooth}), dt=step)
        assert result.converged, result.message
        states = simulation.joint_states()
        q, v, efforts = (
            np.array([getattr(states[joint.name], name) for joint in arm.joints])
            for name in ("position", "velocity", "effort")
        )
        pose, wrench = simulation.targets["wrist"], result.reactions["wrist"]
        place = np.concatenate([pose.translation, pose.rotation])
        energy = arm.dynamics.kinetic_energy(q, v) + arm.dynamics.potential_energy(q, GRAVITY)
        if last is None:
            start = energy
        else:
            work += float(0.5 * (efforts + last[0]) @ (q - last[1]))
            hand += float(0.5 * (wrench + last[2]) @ (place - last[3]))
        last = efforts, q, wrench, place
    assert work > 1.0
    assert work == pytest.approx(energy - start + hand, rel=3e-3)
    # The block's own account: what the handle gave it is kinetic, elastic and potential energy, or dissipated.
    given = result.energies
    assert given["work"] == pytest.approx(hand, rel=1e-3)


@pytest.mark.slow
def test_arm_grasp_keeps_what_is_promised() -> None:
    """With every step solved, arm_grasp holds the box without drift, with the efforts of the weights."""
    found = measure({"solver.skip": []})
    assert found["converged"]
    assert found["drift"] < 1e-7
    assert found["effort error"] < 0.01
    assert found["balance"] < 0.01
