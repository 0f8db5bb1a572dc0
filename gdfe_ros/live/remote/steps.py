# SPDX-License-Identifier: Apache-2.0
"""Reception of a node's lifecycle state, diagnostics and steps for a page."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription
from rclpy.validate_full_topic_name import validate_full_topic_name

from gdfe_ros.actuators import Actuator, ActuatorState, Mode
from gdfe_ros.errors import GdfeError
from gdfe_ros.live.interface import Reading, View
from gdfe_ros.node.interface import topics
from gdfe_ros.node.interface.topics import state_topics
from gdfe_ros.node.middleware.channel import namesakes
from gdfe_ros.node.middleware.ros_types import interface_class
from gdfe_ros.recording.message_tables import STRAIN
from gdfe_ros.recording.step import StepRecord
from gdfe_ros.scene.scene import Scene
from gdfe_ros.testing.published_state import PublishedState, StepMessages, unpack

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
        self._name, self._say, self._on_step = name, say, ""
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
            if state.label != self._on_step:
                self._on_step = state.label
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
"""Texts in a node's report: lifecycle state while active, message while a bag is written, and clock while paused."""


@dataclass(frozen=True)
class NodeReport:
    """Report that a node publishes once a second.

    Attributes:
        text: activity or problem of the node; empty if the node is active without a problem or a long task.
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


_QOS = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_MOST = 16
"""Largest number of incomplete steps that are stored."""
_INTERVAL = 1.0 / 60.0
"""Shortest time between two steps that are decoded [s]; steps in between are not shown."""


class Steps:
    """Subscribes to the topics of a scene's state, and passes on the newest complete step.

    The step records are always received. Other topics are subscribed to only while there are viewers, because the node
    makes no message for a topic without subscriber.

    Args:
        node: node of the subscriptions.
        name: full name of the simulation's node.
        scene: scene of the simulation.
        consumed: function that is called with the record of each step, shown or not.
        on_step: function that is called with each shown step, in a separate thread.
        failed: function that is called in the separate thread with the exception that ended it.
    """

    def __init__(
        self,
        node: Node,
        name: str,
        scene: Scene,
        *,
        consumed: Callable[[StepRecord], None],
        on_step: Callable[[PublishedState], None],
        failed: Callable[[Exception], None],
    ) -> None:
        self._scene, self._consumed, self._on_step, self._failed = scene, consumed, on_step, failed
        self._specs, self._node, self._name = state_topics(scene), node, name
        self._subscriptions: list[Subscription] = []
        self._parts = StepMessages(self._specs, most=_MOST)
        self._newest: dict[str, Any] | None = None
        self._come, self._ending = threading.Event(), threading.Event()
        self._subscribe(topics.STEP_RECORD.key())
        self._thread = threading.Thread(target=self._work, name="gdfe-listener", daemon=True)
        self._thread.start()

    def listen(self, wanted: bool) -> None:
        """Begin or end the subscriptions for drawing; called in the thread that spins the node."""
        if wanted and not self._subscriptions:
            others = [key for key in self._specs if key != topics.STEP_RECORD.key()]
            self._subscriptions = [self._subscribe(key) for key in others]
        elif not wanted and self._subscriptions:
            for subscription in self._subscriptions:
                self._node.destroy_subscription(subscription)
            self._subscriptions = []

    def close(self) -> None:
        """End the thread."""
        self._ending.set()
        self._come.set()
        self._thread.join()

    def _subscribe(self, key: str) -> Subscription:
        kind = interface_class(self._specs[key].type)
        return self._node.create_subscription(kind, f"{self._name}/{key}", partial(self._hear, key), _QOS)

    def _hear(self, key: str, message: Any) -> None:
        """Store a message until all messages of its step have arrived; then drop older steps."""
        if key == topics.STEP_RECORD.key():
            self._consumed(StepRecord.from_json(message.data))
        if (parts := self._parts.add(key, message)) is not None:
            self._newest = parts
            self._come.set()

    def _work(self) -> None:
        try:
            while not self._ending.is_set():
                self._come.wait()
                self._come.clear()
                newest, self._newest = self._newest, None
                if newest is not None:
                    self._on_step(unpack(self._scene, newest))
                self._ending.wait(_INTERVAL)
        except Exception as error:
            self._failed(error)


def view_of(state: PublishedState, scene: Scene) -> View:
    """Return the view of a received step."""
    joints = [joint.name for arm in scene.arms for joint in arm.joints]
    columns = dict(zip(STRAIN.names, state.strain.T, strict=True))
    return View(
        record=state.record,
        positions=state.positions,
        velocities=state.velocities,
        fields=lambda: columns,
        poses=state.poses,
        wrenches=state.wrenches,
        contacts=lambda: state.contacts,
        actuators={each.name: _readings(each, *state.joints[each.name]) for each in scene.actuators},
        joints={name: state.joints[name][0] for name in joints},
    )


def _readings(actuator: Actuator, position: float, speed: float, effort: float) -> list[Reading]:
    """Return the readings of an actuator from its values in ``~/joint_states``."""
    mode, (name, unit) = actuator.mode, actuator.mode.position
    extent, *efforts = ActuatorState(mode, position, position, effort).readings()
    return [extent if mode is Mode.GRIP else (name, position, unit), *efforts]
