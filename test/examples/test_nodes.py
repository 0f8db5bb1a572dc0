# SPDX-License-Identifier: Apache-2.0
"""The example nodes: a controller in the loop, and two robots in one process."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections import Counter
from functools import partial
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import String

from gdfe_ros.examples.tip_tracking import TipTracking
from gdfe_ros.testing import Simulator

PATIENT = 300.0
"""Patience [s], longer than any step or Jacobian takes: only lost messages are requested again."""


class Forgetful(TipTracking):
    """A controller that drops some poses and commands; its patience then ends at once.

    Poses and commands are counted separately, so that their timing does not decide which of them are dropped.
    """

    lost = 0

    def __init__(self, **options: Any) -> None:
        self._counts: Counter[str] = Counter()
        super().__init__(**options)

    def _take_state(self, message: PoseStamped | JointState) -> None:
        if isinstance(message, JointState) or self._keep("pose", 3):
            super()._take_state(message)

    def _send(self, command: Any) -> None:
        if self._keep("command", 5):
            super()._send(command)

    def _keep(self, what: str, every: int) -> bool:
        self._counts[what] += self._start is not None
        lose = self._start is not None and self._counts[what] % every == 0
        if lose:
            self.lost += 1
            self._waiting_since = time.monotonic() - PATIENT
        return not lose


def _start(kind: type[TipTracking], simulator: Simulator, **parameters: float) -> TipTracking:
    """Return a patient controller of ``simulator`` that leads the tip round a circle of 5 mm."""
    values = {"simulation": simulator.name, "radius": 0.005, "patience": PATIENT, **parameters}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return kind(context=simulator.context, parameter_overrides=overrides)


@pytest.mark.parametrize("name", ["two_robots", "tip_tracking", "tip_follower", "carrying_arm"])
def test_help_says_what_a_node_is_for(name: str) -> None:
    """Each node prints help and refuses unknown arguments, without starting a node."""
    run = partial(subprocess.run, capture_output=True, text=True, timeout=60, check=False)
    done = run([sys.executable, "-m", f"gdfe_ros.examples.{name}", "--help"])
    assert (done.returncode, done.stdout.splitlines()[0]) == (0, f"usage: {name} [--help] [--ros-args ...]")
    done = run([sys.executable, "-m", f"gdfe_ros.examples.{name}", "left"])
    assert (done.returncode, done.stderr) == (2, f"{name}: unknown arguments left; see {name} --help\n")


def test_the_controller_node_leads_the_tip_round() -> None:
    """In 40 steps of a round of 100, the node keeps the tip within 5 % of the radius."""
    overrides = {"solver.tolerance": 1e-6}
    with Simulator("three_chamber_arm", overrides=overrides, inputs=[]) as simulator:
        node = _start(TipTracking, simulator, period=1.0)
        simulator.spin(node, steps=40)
        node.destroy_node()
    assert len(node.errors) >= 38
    assert max(node.errors) < 0.05 * 0.005


def test_the_controller_keeps_up_with_the_wall_clock() -> None:
    """With the wall clock and the default tolerance, the tip stays near its goal over 80 commands in a row.

    While another process has the processor, no command arrives at all. The test waits for 80 good commands in a row.
    """
    parameters = {"clock": "wall", "publish_clock": True}
    with Simulator("three_chamber_arm", parameters=parameters, inputs=[]) as simulator:
        node = _start(TipTracking, simulator, period=2.0)
        states = []
        while len(node.errors) < 80 or not _keeps_up(node.errors[-80:]):
            assert len(node.errors) < 4000, "it never kept up"
            states += simulator.spin(node, steps=10)
        node.destroy_node()
    assert all(state.record.converged for state in states)


def _keeps_up(errors: list[float]) -> bool:
    """Return whether the tip stayed near the goal, relative to the radius of its circle."""
    return np.median(errors) < 0.05 * 0.005 and max(errors) < 0.3 * 0.005


def test_the_controller_bears_lost_messages() -> None:
    """With every third pose and every fifth command lost, the node asks again, and the tip stays near the goal."""
    with Simulator("three_chamber_arm", inputs=[]) as simulator:
        node = _start(Forgetful, simulator, period=2.0)
        simulator.spin(node, steps=40)
        node.destroy_node()
    assert node.lost > 5
    # Where something is lost, the tip falls some steps behind its goal, and makes up for it.
    assert _keeps_up(node.errors)


class LateScene(TipTracking):
    """A controller that gets the scene only after the first state."""

    def _take_scene(self, message: String) -> None:
        if any(len(parts) == 2 for parts in self._parts.values()):
            super()._take_scene(message)
        else:
            self.executor.create_task(self._take_scene, message)


def test_the_controller_starts_with_messages_in_any_order() -> None:
    """A node that gets the scene after a state, which lockstep does not repeat, still starts."""
    with Simulator("three_chamber_arm", inputs=[]) as simulator:
        node = _start(LateScene, simulator)
        simulator.spin(node, steps=2)
        node.destroy_node()
    assert node.errors


def test_two_robots_publish_from_one_process(ros: Any) -> None:
    """Both robots of the composition example publish their meshes, and SIGINT ends it with status 0."""
    node, seen = ros.node("watcher"), set()
    for name in ("left", "right"):
        node.create_subscription(PointCloud2, f"/{name}/gdfe_sim/mesh", lambda _, name=name: seen.add(name), 10)
    process = subprocess.Popen([sys.executable, "-m", "gdfe_ros.examples.two_robots"])
    try:
        ros.wait(lambda: len(seen) == 2, alive=lambda: process.poll() is None)
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(300) == 0
