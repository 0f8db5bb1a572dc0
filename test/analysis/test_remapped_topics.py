# SPDX-License-Identifier: Apache-2.0
"""Runs of a node with remapped topics: every array is still found, compared and reported."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.cli import main
from gdfe_ros.recording.recovery import recover
from gdfe_ros.recording.step import StepRecord
from gdfe_ros.testing import forking
from test.analysis.conftest import rewrite

REMAPS = {
    "mesh": "/cloud",
    "step_record": "/records/sim",
    "handles/tip/target": "/goal",
    "handles/tip/pose": "/tip/pose",
    "handles/tip/wrench": "/sensor",
    "scene": "/what",
}
PARAMETERS = ["scene:=bend5", "scene_overrides:=['mesh.bar.cells=[10, 1, 1]']", "clock:=lockstep", "record:=true"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[], forking.Forked]]:
    """Give a function that starts a recording node with remaps; the node is stopped after the test."""
    processes = []

    def make() -> forking.Forked:
        given = [word for text in [*PARAMETERS, f"bag_path:={tmp_path / 'bag'}"] for word in ("-p", text)]
        given += [word for role, name in REMAPS.items() for word in ("-r", f"~/{role}:={name}")]
        processes.append(forking.start(["--ros-args", *given], tmp_path / "log.txt", os.environ))
        return processes[-1]

    yield make
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def bag(ros: Any, start: Callable[[], forking.Forked], tmp_path: Path) -> Path:
    """Return the bag of three steps commanded over a remapped topic."""
    node, records = ros.node("commander"), []
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(String, "/records/sim", lambda m: records.append(StepRecord.from_json(m.data)), latched)
    goal = node.create_publisher(PoseStamped, "/goal", 10)
    process = start()

    def wait(count: int) -> None:
        ros.wait(
            lambda: len({record.step for record in records}) >= count and goal.get_subscription_count(),
            alive=lambda: process.poll() is None,
        )

    wait(1)
    for step in range(1, 4):
        message = PoseStamped()
        message.pose.position.z = 0.01 * step
        goal.publish(message)
        wait(step + 1)
    process.send_signal(signal.SIGINT)
    assert process.wait(300) == 0
    return tmp_path / "bag"


@pytest.mark.exact("the node's process shifts nothing")
def test_a_remapped_run_is_replayed_and_reported(bag: Path, tmp_path: Path) -> None:
    """A run with remapped outputs, record and input is replayed, recovered, compared and reported completely."""
    run = BagRun(bag)
    assert {role: run.roles[role] for role in REMAPS} == REMAPS
    report = Replay(run).run()
    assert report.verdict() is Difference.IDENTICAL
    topics = {topic for topic, _ in report.differences.fields}
    assert {"mesh", "step_record", "handles/tip/pose", "handles/tip/wrench", "strain", "handles/base/pose"} <= topics
    assert report.differences.steps == len(run.records) == 4
    assert set(run.last_wrenches()) == {"base", "tip"}
    assert main(["report", str(bag), "--out", str(tmp_path / "report.html")]) == 0
    assert main(["replay", str(recover(bag, tmp_path / "new").path)]) == 0
    assert main(["compare", str(bag), str(tmp_path / "new")]) == 0
    assert main(["replay", str(bag), "--ros"]) == 0


def test_a_topic_that_nobody_knows_is_said_to_be_left_out(make_bag: Callable, tmp_path: Path, capsys: Any) -> None:
    """Replay and compare name the unknown topic /cloud as not compared, and do not succeed."""
    cloud = {"name": "/cloud", "role": ""}
    path = rewrite(
        make_bag("whole", heights=[0.0]),
        tmp_path / "bag",
        topic=lambda topic: replace(topic, **cloud) if topic.role == "mesh" else topic,
    )
    assert main(["replay", str(path)]) == 1
    shown = capsys.readouterr().out
    assert "not compared, because the replay has none of it: /cloud" in shown
    assert "incomplete, bit-identical as far as it was compared" in shown
    assert main(["compare", str(path), str(path)]) == 1
    assert "which topics of the node they are: /cloud of A" in capsys.readouterr().out
