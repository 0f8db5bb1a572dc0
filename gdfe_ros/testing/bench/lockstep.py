# SPDX-License-Identifier: Apache-2.0
"""Thousands of commands in lockstep, sent ahead of their steps: each makes one step, in order, none is lost."""

from __future__ import annotations

import time
from dataclasses import dataclass

from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from gdfe_ros.node.interface import STEP_RECORD
from gdfe_ros.recording.step_record import StepRecord
from gdfe_ros.testing.bench.client import Client, height
from gdfe_ros.testing.process import NodeProcess

_AHEAD = 500
"""Commands that may be under way: half of what the publisher keeps."""


@dataclass(frozen=True)
class Lockstep:
    """What became of the commands.

    Attributes:
        sent: commands.
        consumed: steps that consumed the command of their number.
        seconds: from the first command to the last step.
    """

    sent: int
    consumed: int
    seconds: float


def measure(count: int) -> Lockstep:
    """Send ``count`` commands to a coarse bar and look up which steps consumed which."""
    parameters = {"scene_overrides": ["mesh.bar.cells=[10, 2, 2]"], "clock": "lockstep"}
    with Client(STEP_RECORD, keep=(STEP_RECORD,)) as client, NodeProcess(parameters):
        client.wait_for_node()
        client.wait(lambda: client.counts[STEP_RECORD.name])
        started = time.monotonic()
        for number in range(1, count + 1):
            client.wait(lambda number=number: number - client.counts[STEP_RECORD.name] < _AHEAD)
            client.command(number)
        client.wait(lambda: client.counts[STEP_RECORD.name] > count)
        seconds = time.monotonic() - started
        texts = [deserialize_message(data, String).data for data in client.kept[STEP_RECORD.name]]
    records = [StepRecord.from_json(text) for text in texts]
    right = [
        record.step
        for record in records
        if record.handles and record.handles["tip"].translation[2] == height(record.step)
    ]
    return Lockstep(count, len(set(right)), seconds)
