# SPDX-License-Identifier: Apache-2.0
"""Every case of the torture catalogue, judged; the full test is ``make torture``."""

from __future__ import annotations

import os
from dataclasses import replace

import pytest

from benchmarks.torture.case import Case, Verdict, attempt
from benchmarks.torture.catalogue import all_cases
from benchmarks.torture.walks import STEPS
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Policy

WALK_STEPS = int(os.environ.get("TORTURE_WALK_STEPS", STEPS))
"""Number of steps of each random walk."""
CASES = all_cases(walk_steps=WALK_STEPS)


@pytest.fixture(scope="session", autouse=True)
def kernels() -> None:
    """Load the compiled kernels, so that the first cases do not include that time."""
    for name in ("bend5", "three_chamber_arm", "tendon_finger", "shape_memory_strip", "tensile_curve"):
        for policy in Policy:
            scene = load_scene(name)
            if policy is Policy.ENERGY or not (scene.loads or scene.actuators):
                Simulation(replace(scene, solver=replace(scene.solver, policy=policy))).warm_up()


@pytest.mark.torture
@pytest.mark.parametrize("case", CASES, ids=[case.id for case in CASES])
def test_torture(case: Case) -> None:
    """Each case passes, or is refused with the expected words."""
    outcome = attempt(case)
    assert outcome.verdict is not Verdict.FAILED, outcome.text
