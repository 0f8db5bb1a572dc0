# SPDX-License-Identifier: Apache-2.0
"""The examples as nodes: a controller in the loop, and two robots in one process."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter
from sensor_msgs.msg import PointCloud2

from gdfe_ros.examples.tip_tracking import TipTracking
from gdfe_ros.testing import Simulator


class Forgetful(TipTracking):
    """Loses poses and commands on purpose."""

    lost = calls = 0

    def _take_pose(self, message: PoseStamped) -> None:
        if self._keep(3):
            super()._take_pose(message)

    def _send(self, command: Any) -> None:
        if self._keep(5):
            super()._send(command)

    def _keep(self, every: int) -> bool:
        self.calls += 1
        lose = self._start is not None and self.calls % every == 0
        self.lost += lose
        return not lose


def test_the_controller_node_leads_the_tip_round() -> None:
    """Spin the node for 40 steps of a circle of 100: it stays within 5 % of the radius."""
    overrides = {"solver.tolerance": 1e-6}
    with Simulator("three_chamber_arm", overrides=overrides, inputs=[]) as simulator:
        parameters = {"simulation": simulator.name, "period": 1.0, "radius": 0.005}
        node = TipTracking(
            context=simulator.context,
            parameter_overrides=[Parameter(name, value=value) for name, value in parameters.items()],
        )
        simulator.spin(node, steps=40)
        node.destroy_node()
    assert len(node.errors) >= 38
    assert max(node.errors) < 0.05 * 0.005


def test_the_controller_keeps_up_with_the_wall_clock() -> None:
    """Let the simulation run on by itself, with its own tolerance: a late command costs little and is made up for.

    While another process has the processor, no command comes at all: some 80 commands in a row must keep up.
    """
    parameters = {"clock": "wall", "publish_clock": True}
    with Simulator("three_chamber_arm", parameters=parameters, inputs=[]) as simulator:
        own = {"simulation": simulator.name, "period": 2.0, "radius": 0.005}
        node = TipTracking(
            context=simulator.context,
            parameter_overrides=[Parameter(name, value=value) for name, value in own.items()],
        )
        states = []
        while len(node.errors) < 80 or not _keeps_up(node.errors[-80:]):
            assert len(node.errors) < 4000, "it never kept up"
            states += simulator.spin(node, steps=10)
        node.destroy_node()
    assert all(state.record.converged for state in states)


def _keeps_up(errors: list[float]) -> bool:
    """Tell whether the tip stayed near the goal, by the radius of its circle."""
    return np.median(errors) < 0.05 * 0.005 and max(errors) < 0.3 * 0.005


def test_the_controller_bears_lost_messages() -> None:
    """Drop every third pose and every fifth command: it asks again where nothing comes, and stays near the goal."""
    with Simulator("three_chamber_arm", inputs=[]) as simulator:
        own = {"simulation": simulator.name, "period": 2.0, "radius": 0.005, "patience": 1.0}
        node = Forgetful(
            context=simulator.context,
            parameter_overrides=[Parameter(name, value=value) for name, value in own.items()],
        )
        simulator.spin(node, steps=24)
        node.destroy_node()
    assert node.lost > 5
    # How many are lost in a row depends on when it asks again: it may fall some steps behind, and makes up for it.
    assert np.median(node.errors) < 0.1 * 0.005
    assert max(node.errors) < 0.5 * 0.005


def test_two_robots_publish_from_one_process(ros: Any) -> None:
    """Start the composition example: both meshes arrive, and SIGINT ends it with status 0."""
    node, seen = ros.node("watcher"), set()
    for name in ("left", "right"):
        node.create_subscription(PointCloud2, f"/{name}/gdfe_sim/mesh", lambda _, name=name: seen.add(name), 10)
    process = subprocess.Popen([sys.executable, "-m", "gdfe_ros.examples.two_robots"])
    try:
        end = time.monotonic() + 300.0
        while len(seen) < 2 and time.monotonic() < end:
            assert process.poll() is None
            ros.executor.spin_once(timeout_sec=0.1)
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(300) == 0
    assert seen == {"left", "right"}
