# SPDX-License-Identifier: Apache-2.0
"""The examples as nodes: a controller in the loop, and two robots in one process."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from typing import Any

from rclpy.parameter import Parameter
from sensor_msgs.msg import PointCloud2

from gdfe_ros.examples.tip_tracking import TipTracking
from gdfe_ros.testing import Simulator


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


def test_two_robots_publish_from_one_process(ros: Any) -> None:
    """Start the composition example: both meshes arrive, and SIGINT ends it with status 0."""
    node, seen = ros.node("watcher"), set()
    for name in ("left", "right"):
        node.create_subscription(PointCloud2, f"/{name}/gdfe_sim/mesh", lambda _, name=name: seen.add(name), 10)
    process = subprocess.Popen([sys.executable, "-m", "gdfe_ros.examples.two_robots"])
    try:
        end = time.monotonic() + 300.0
        while len(seen) < 2 and time.monotonic() < end:
            ros.executor.spin_once(timeout_sec=0.1)
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(300) == 0
    assert seen == {"left", "right"}
