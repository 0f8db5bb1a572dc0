# SPDX-License-Identifier: Apache-2.0
"""The search for a node to show, and what its diagnostics say."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.validate_full_topic_name import validate_full_topic_name

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface import topics
from gdfe_ros.node.strays import namesakes

_LOST = 2.0
"""Time after which a request is repeated [s]. A node that has not discovered the client yet cannot answer it."""


def full_name(name: str) -> str:
    """Return the full name of a node.

    Raises:
        GdfeError: the name is invalid.
    """
    full = f"/{name.strip('/')}"
    try:
        validate_full_topic_name(f"{full}/{topics.SCENE.key()}")
    except InvalidTopicNameException as error:
        allowed = "letters, digits and underscores, e.g. gdfe_sim, or left/gdfe_sim in a namespace"
        raise GdfeError(f"{name!r} is no name of a node; allowed: {allowed}") from error
    return full


class Waiting:
    """Reports each change of a node's lifecycle state while its scene is awaited.

    Args:
        node: node that requests the state.
        name: full name of the awaited node.
        say: function that receives the texts.
    """

    def __init__(self, node: Node, name: str, say: Callable[[str], None]) -> None:
        self._name, self._say, self._told = name, say, ""
        self._client = node.create_client(GetState, f"{name}/get_state")
        self._answer: Any = None
        self._asked = 0.0

    def look(self) -> None:
        """Request the state, or report the answer if it has arrived; called in the thread that spins the node."""
        if self._answer is None or (not self._answer.done() and time.monotonic() > self._asked + _LOST):
            if self._client.service_is_ready():
                self._answer, self._asked = self._client.call_async(GetState.Request()), time.monotonic()
        elif self._answer.done():
            state, self._answer = self._answer.result().current_state, None
            if state.label != self._told:
                self._told = state.label
                bare = state.id == State.PRIMARY_STATE_UNCONFIGURED
                remedy = f"; it publishes its scene after: {configuring(self._name)}" if bare else ""
                self._say(f"the node {self._name} is {state.label}{remedy}")


def configuring(name: str) -> str:
    """Return the text of the commands that configure and activate a node."""
    return f"gdfe lifecycle {name} configure, then activate"


def absence(node: Node, name: str, patience: float) -> str:
    """Return a message that explains why the scene of a node was not received, and lists the simulating nodes.

    Args:
        node: node that searches the ROS graph.
        name: full name of the awaited node.
        patience: duration of the wait [s].
    """
    if namesakes(node, name):
        return (
            f"node {name} has published no scene within {patience:g} s: it is not configured; remedy: "
            f"{configuring(name)}"
        )
    end = f"/{topics.STEP_RECORD.key()}"
    found = [topic.removesuffix(end) for topic, _ in node.get_topic_names_and_types() if topic.endswith(end)]
    there = f"nodes that simulate: {', '.join(sorted(found))}" if found else "no node simulates here"
    domain = os.environ.get("ROS_DOMAIN_ID", "0")
    remedy = "start one: sim_node --ros-args -p scene:=bend5"
    return f"no node {name} within {patience:g} s; {there} (ROS domain {domain}); {remedy}"


_ACTIVE, _RECORDING, _PAUSED = "active", "recording", "paused"
"""Texts in a node's report: its lifecycle state, its message while it writes a bag, and its clock while paused."""


@dataclass(frozen=True)
class NodeReport:
    """Report that a node publishes once a second.

    Attributes:
        text: activity or problem of the node; empty if the node is active without problems.
        bad: whether there is a problem.
        paused: whether the node is paused.
        bag: path of the bag that the node writes, or None.
    """

    text: str = ""
    bad: bool = False
    paused: bool = False
    bag: str | None = None

    @classmethod
    def of(cls, message: DiagnosticArray, name: str) -> NodeReport | None:
        """Return the report of the node with this full name; None if the message does not contain it."""
        parts = {status.name: status for status in message.status}
        whole, recording, clock = (
            parts.get(f"{name.lstrip('/')}: {part}") for part in ("simulation", "recording", "clock")
        )
        if whole is None:
            return None
        values, bad = _values(whole), whole.level != DiagnosticStatus.OK
        work = values.get("working on", "")
        text = whole.message if bad or values.get("state") != _ACTIVE else work
        return cls(
            text=text,
            bad=bad or values.get("state") != _ACTIVE,
            paused=clock is not None and _values(clock).get("clock") == _PAUSED,
            bag=_values(recording).get("bag") if recording is not None and recording.message == _RECORDING else None,
        )


def _values(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}
