# SPDX-License-Identifier: Apache-2.0
"""Thousands of commands in lockstep, sent ahead of their steps: each must make one step, in order."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from benchmarks.node.client import Client, height
from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.node.interface.topics import STEP_RECORD
from gdfe_ros.recording.step import StepRecord
from gdfe_ros.testing.process import NodeProcess

_AHEAD = 500
"""Largest number of commands in transit: half of the publisher's queue."""


@dataclass(frozen=True)
class Lockstep:
    """Result for commands in lockstep.

    Attributes:
        sent: number of commands.
        consumed: number of steps that consumed the command with their number.
    """

    sent: int
    consumed: int


def measure(count: int) -> Lockstep:
    """Send ``count`` commands to a coarse bar, and compare them with the commands that the steps consumed.

    The consumed commands are read from a bag, because a slow subscriber of the records loses all except the last ten of
    a burst.
    """
    with TemporaryDirectory(prefix="gdfe_lockstep_") as folder:
        bag = Path(folder) / "bag"
        parameters = {
            "scene_overrides": ["mesh.bar.cells=[10, 2, 2]"],
            "clock": "lockstep",
            "record": True,
            "bag_path": str(bag),
        }
        with Client(STEP_RECORD, keep=(STEP_RECORD,)) as client, NodeProcess(parameters) as node:
            _send(client, count)
            node.stop()
        records = BagRun(bag).records
    right = [
        record.step
        for record in records
        if record.handles and record.handles["tip"].translation[2] == height(record.step)
    ]
    return Lockstep(count, len(set(right)))


def _send(client: Client, count: int) -> None:
    """Send the commands, at most `_AHEAD` ahead of the steps, and wait for the last step."""
    kept = client.kept[STEP_RECORD.name]

    def made() -> int:
        """Return the number of the last step, from its record or from the diagnostics."""
        last = StepRecord.from_json(deserialize_message(kept[-1], String).data).step if kept else 0
        del kept[:-1]
        return max(last, int(client.values.get("steps", 1)) - 1)

    client.wait_for_node()
    for number in range(1, count + 1):
        client.wait(lambda number=number: number - made() < _AHEAD)
        client.command(number)
    client.wait(lambda: made() >= count)
