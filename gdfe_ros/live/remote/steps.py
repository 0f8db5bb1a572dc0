# SPDX-License-Identifier: Apache-2.0
"""Assembly of a node's messages into steps."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription

from gdfe_ros.actuators import Actuator, ActuatorState, Mode
from gdfe_ros.live.interface import Reading, View
from gdfe_ros.node.interface import topics
from gdfe_ros.node.interface.topics import state_topics
from gdfe_ros.node.ros_types import interface_class
from gdfe_ros.recording.published import STRAIN
from gdfe_ros.recording.step_record import StepRecord
from gdfe_ros.scene.scene import Scene
from gdfe_ros.testing.state import PublishedState, StepMessages, unpack

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
        told: function that is called with each shown step, in a separate thread.
        failed: function that is called in the separate thread with the exception that ended it.
    """

    def __init__(
        self,
        node: Node,
        name: str,
        scene: Scene,
        *,
        consumed: Callable[[StepRecord], None],
        told: Callable[[PublishedState], None],
        failed: Callable[[Exception], None],
    ) -> None:
        self._scene, self._consumed, self._told, self._failed = scene, consumed, told, failed
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
                    self._told(unpack(self._scene, newest))
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
    mode = actuator.mode
    found = ActuatorState(mode, position, position, effort).readings()
    if mode in (Mode.GROWTH, Mode.SHORTENING):  # whose positions are their commands, unlike their extents
        found[0] = (mode.value, *found[0][1:])
    return found
