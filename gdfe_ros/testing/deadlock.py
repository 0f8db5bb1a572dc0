# SPDX-License-Identifier: Apache-2.0
"""Detection of a simulation in lockstep that waits for a command which no controller sends."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from gdfe_ros.node.interface.topics import DIAGNOSTICS

_DISCOVERY = 5.0
"""Longest time until a publisher of a running node is discovered, even on a busy machine [s]."""
_BLOCKED = 1.0
"""If more time passes between two looks [s], a callback of the controller was computing."""


class Deadlock:
    """Detects that the steps have ended because a command is missing.

    Args:
        node: node of the test, not of the controller; its own publishers do not count.
        simulation: full name of the simulation's node.
        inputs: full names of the topics for which each step waits; empty: a step begins with any command.
        controller: node whose commands are awaited.
        silence: longest time for which the simulation may wait for a command [s].
    """

    def __init__(self, node: Node, simulation: str, inputs: Sequence[str], controller: Node, *, silence: float) -> None:
        self._node, self._prefix, self._inputs = node, f"{simulation.lstrip('/')}: ", inputs
        self._controller, self._silence = controller, silence
        self._waits, self._idle, self._looked = "", 0.0, monotonic()
        self._subscription = node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, self._read, 10)

    def progress(self) -> None:
        """Note that a step was made."""
        self._idle = 0.0

    def reason(self) -> str:
        """Return why there will be no further step; empty if there may be one. Called repeatedly during the wait."""
        now = monotonic()
        spent, self._looked = now - self._looked, now
        self._idle = self._idle + spent if self._waits and spent < _BLOCKED else 0.0
        if self._idle < _DISCOVERY:
            return ""
        if missing := [topic for topic in self._inputs if not self._published(topic)]:
            own = sorted({publisher.topic_name for publisher in self._controller.publishers})
            return (
                f"each step waits for a message on {', '.join(missing)}, which no controller publishes; "
                f"{self._controller.get_name()} publishes {', '.join(own) or 'nothing'}; "
                "remedy: the name of the topic, or `inputs` with the topics of the controller"
            )
        if self._idle < self._silence:
            return ""
        return f"the simulation {self._waits} for {self._silence:g} s, and no controller has sent it"

    def close(self) -> None:
        """Destroy the subscription."""
        self._node.destroy_subscription(self._subscription)

    def _published(self, topic: str) -> bool:
        found = self._node.get_publishers_info_by_topic(topic)
        return any(each.node_name != self._node.get_name() for each in found)

    def _read(self, message: DiagnosticArray) -> None:
        """Store what the simulation waits for; nothing while it works on a step, or without lockstep."""
        own = [value for status in message.status if status.name.startswith(self._prefix) for value in status.values]
        values = {value.key: value.value for value in own}
        if values:
            waits = "waits for" in values and "working on" not in values
            self._waits = f"waits for {values['waits for']}" if waits else ""
