# SPDX-License-Identifier: Apache-2.0
"""Runs with the wall clock, by a node in its own process, replayed without ROS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.constraints import Pose
from gdfe_ros.simulation import Command
from gdfe_ros.testing.simulator import Simulator


@pytest.mark.exact("the node's process shifts nothing")
@pytest.mark.parametrize("deadline", [0.0, 0.001])
def test_a_run_under_the_wall_clock_replays(tmp_path: Path, deadline: float) -> None:
    """A run with poses at 100 Hz, with and without a deadline that cuts most solves, replays with the same bits."""
    overrides = {"mesh.bar.cells": [20, 2, 2], "solver.tolerance": 1e-8}
    parameters = {"clock": "wall", "rate": 100.0, "deadline": deadline, "command_set": [""]}
    with Simulator("bend5", overrides=overrides, parameters=parameters, bag=tmp_path / "bag") as simulator:
        for z in np.linspace(0.005, 0.1, 20):
            simulator.step(Command(handles={"tip": Pose(translation=(0.0, 0.0, float(z)))}))
    run = BagRun(tmp_path / "bag")
    cut = sum(record.cut for record in run.records[:-1])  # the end of the run may cut the last one
    assert cut > 5 if deadline else cut == 0
    report = Replay(run).run()
    assert report.differences.verdict() is Difference.IDENTICAL
    assert report.differences.steps == len(run.records) >= 20
