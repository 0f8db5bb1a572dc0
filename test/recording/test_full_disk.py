# SPDX-License-Identifier: Apache-2.0
"""A real node whose bag finds no more room: said at once, counted the same everywhere, and the simulation goes on."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import SetBool

from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.step_record import StepRecord
from gdfe_ros.testing import NodeProcess
from gdfe_ros.testing.discovery import await_discovery

PARAMETERS = {
    "scene": "bend5",
    "scene_overrides": ["mesh.bar.cells=[25, 4, 4]"],
    "publish_clock": True,
    "record": True,
}
ROOM = 5 << 20
"""More than is reserved at first [B]: what was promised then can still be written."""
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.mark.parametrize("clock", ["wall", "fast"])
def test_a_full_disk_is_told_at_once_and_agreed_upon(ros: Any, tmp_path: Path, clock: str) -> None:
    """Let a file grow to 5 MiB only: log, diagnostics, bag and ~/record agree, and steps go on being made."""
    node, steps, counts = ros.node("watcher"), [], []

    def count(message: DiagnosticArray) -> None:
        values = {value.key: value.value for status in message.status for value in status.values}
        counts.append((values.get("messages dropped"), values.get("messages written"), values.get("bag error", "none")))

    node.create_subscription(
        String, "/gdfe_sim/step_record", lambda m: steps.append(StepRecord.from_json(m.data)), LATCHED
    )
    node.create_subscription(DiagnosticArray, "/diagnostics", count, LATCHED)
    record = node.create_client(SetBool, "/gdfe_sim/record")
    bag, end = tmp_path / "bag", time.monotonic() + 300.0
    with NodeProcess({**PARAMETERS, "clock": clock, "bag_path": str(bag)}) as process:

        def wait(done: Callable[[], Any]) -> Any:
            while not (value := done()):
                assert process.running
                assert time.monotonic() < end
                ros.executor.spin_once(timeout_sec=0.05)
            return value

        wait(lambda: steps)
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (ROOM, resource.RLIM_INFINITY))
        wait(lambda: "recording ended, the simulation goes on" in process.log)
        last = steps[-1].step
        wait(lambda: steps[-1].step > last + 20)
        wait(lambda: counts and counts[-1][2] != "none")
        dropped, written, error = counts[-1]
        assert "File too large" in error
        notes = BagReader(bag).notes
        assert (notes["messages_dropped"], notes["messages_written"]) == (dropped, written)
        assert f"{written} messages, {dropped} dropped" in process.log
        wait(record.service_is_ready)
        await_discovery(node, "/gdfe_sim", wait)
        future = record.call_async(SetBool.Request(data=False))
        answer = wait(lambda: future.result() if future.done() else None)
        assert not answer.success
        assert f"{written} messages, {dropped} dropped" in answer.message
        last = steps[-1].step
        wait(lambda: steps[-1].step > last)
        assert process.stop() == 0
    assert len(BagReader(bag)) == int(written)
