# SPDX-License-Identifier: Apache-2.0
"""A real node whose bag runs out of disk space reports it at once, counts consistently, and continues."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String
from std_srvs.srv import SetBool

from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.step import StepRecord
from gdfe_ros.testing import NodeProcess
from gdfe_ros.testing.client import LONGEST_WAIT, STATE_QOS, Client

PARAMETERS = {
    "scene": "bend5",
    "scene_overrides": ["mesh.bar.cells=[25, 4, 4]"],
    "publish_clock": True,
    "autostart": False,
    "record": True,
}
ROOM = 5 << 20
"""Room [B], more than is reserved at first, so that the reserved part can still be written."""


class Watcher(Client):
    """Follows steps and the diagnostics of the recording.

    Attributes:
        step: number of the last step; -1 before the first.
        report: messages dropped, messages written and the bag's error, from the last diagnostics.
    """

    def __init__(self, process: NodeProcess) -> None:
        super().__init__(process, "/gdfe_sim", "watcher", patience=LONGEST_WAIT)
        self.step, self.report = -1, ["", "", ""]
        self._record = self.node.create_client(SetBool, "/gdfe_sim/record")
        self.node.create_subscription(String, "/gdfe_sim/step_record", self._see, STATE_QOS)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._read, STATE_QOS)
        self.meet([self._record])

    def wait_for_steps(self, count: int) -> None:
        """Wait until ``count`` more steps are made."""
        last = self.step
        self.wait(lambda: self.step >= last + count, f"{count} steps")

    def stop_recording(self) -> SetBool.Response:
        """Request the end of the bag."""
        return self.call(self._record, SetBool.Request(data=False))

    def _see(self, message: String) -> None:
        self.step = StepRecord.from_json(message.data).step

    def _read(self, message: DiagnosticArray) -> None:
        values = {value.key: value.value for status in message.status for value in status.values}
        self.report = [values.get(key, "") for key in ("messages dropped", "messages written", "bag error")]


@contextmanager
def confined(clock: str, bag: Path) -> Iterator[tuple[NodeProcess, Watcher]]:
    """Give an active node whose files are limited, and its watcher."""
    with (
        NodeProcess({**PARAMETERS, "clock": clock, "bag_path": str(bag)}) as process,
        closing(Watcher(process)) as watcher,
    ):
        watcher.transition("configure")
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (ROOM, resource.RLIM_INFINITY))
        watcher.transition("activate")
        yield process, watcher


@pytest.mark.parametrize("clock", ["wall", "fast"])
def test_a_full_disk_is_told_at_once_and_agreed_upon(tmp_path: Path, clock: str) -> None:
    """With files limited to 5 MiB, log, diagnostics, bag and ~/record agree, and steps continue."""
    bag = tmp_path / "bag"
    with confined(clock, bag) as (process, watcher):
        watcher.wait(lambda: "recording ended, the simulation goes on" in process.log, "the end of the recording")
        watcher.wait_for_steps(20)
        watcher.wait(lambda: "File too large" in watcher.report[2], "the error in diagnostics")
        dropped, written, _ = watcher.report
        notes = BagReader(bag).notes
        assert (notes["messages_dropped"], notes["messages_written"]) == (dropped, written)
        assert f"{written} messages, {dropped} dropped" in process.log
        answer = watcher.stop_recording()
        assert not answer.success
        assert f"{written} messages, {dropped} dropped" in answer.message
        watcher.wait_for_steps(1)
        assert process.stop() == 0
        assert "Traceback" not in process.log
    assert len(BagReader(bag)) == int(written)


def test_a_node_whose_disk_is_full_ends_in_order(tmp_path: Path) -> None:
    """A node with files limited to 5 MiB, ended by SIGINT, leaves no traceback and a bag with the counted messages."""
    bag = tmp_path / "bag"
    with confined("fast", bag) as (process, watcher):
        watcher.wait(lambda: "File too large" in watcher.report[2], "the error in diagnostics")
        assert process.stop() == 0
        assert "Traceback" not in process.log
        assert "severity" not in process.log
    assert len(BagReader(bag)) == int(watcher.report[1])
