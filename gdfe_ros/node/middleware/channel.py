# SPDX-License-Identifier: Apache-2.0
"""Publishers that also record their messages, the thread that publishes steps, and searches for stray publishers."""

from __future__ import annotations

import queue
import re
import threading
import time
from collections.abc import Callable, Collection
from contextlib import ExitStack
from typing import Any

from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import serialize_message

from gdfe_ros.constraints import Handle
from gdfe_ros.node.interface import Delivery, TopicSpec, topics
from gdfe_ros.node.middleware.managed import ManagedNode
from gdfe_ros.node.middleware.ros_types import interface_class, qos_profile, topic_info
from gdfe_ros.node.refusals import Reason, Refusal, RefusalLog
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.step import Step
from gdfe_ros.threads import PUBLISHER, show_name
from gdfe_ros.untrusted.spelling import did_you_mean

_WAITING = 2
"""Largest number of steps in the queue for publishing. While the queue is full, the stepping thread waits."""


class Channel:
    """Publishes messages on a topic and records them in a bag.

    Args:
        node: publishing node.
        spec: description of the topic.
        repeated: whether the last message of a step is published again for new subscribers (`look_for_newcomers`).
        own: number of this node's own subscriptions to the topic; they do not count as subscribers.
        key: name of the topic relative to the node, e.g. ``probe/tip``; needed if the name in ``spec`` is a pattern,
            e.g. ``~/probe/{probe}``. Empty: the name in ``spec``.

    Attributes:
        latest: number of the step that was published last; -1 before the first.
        info: description of the topic for a bag.
        recorded: whether bags contain the topic.
        recorder: recorder of the bag in progress, or None.
    """

    def __init__(
        self, node: ManagedNode, spec: TopicSpec, *, repeated: bool = False, own: int = 0, key: str = ""
    ) -> None:
        self._node, self.recorded, self.latest, self._own = node, spec.recorded, -1, own
        # Latched topics, events and diagnostics publish while the node is not active, too.
        managed = spec.name.startswith("~") and spec.delivery not in (Delivery.LATCHED, Delivery.EVENT)
        make = node.create_lifecycle_publisher if managed else node.create_publisher
        topic = f"~/{key}" if key else spec.name
        self._repeated, self._newcomers, self._unsure, self._known = repeated, False, False, own
        self._greeted: set[bytes] = set()
        self._publisher = make(interface_class(spec.type), topic, qos_profile(spec.delivery))
        # Enter the handle once: rclpy would enter and leave it for each count of subscribers, i.e. in each step.
        self._held, self._count = ExitStack(), self._publisher.get_subscription_count
        if repeated:
            self._held.enter_context(self._publisher.handle)
            self._count = self._publisher.handle.get_subscription_count
        self.info = topic_info(spec, self._publisher.topic_name, topic.removeprefix("~/"))
        self.recorder: Recorder | None = None

    @property
    def wanted(self) -> bool:
        """Whether a subscriber or a bag needs the messages. If not, no message has to be built."""
        return self.recorder is not None or self._count() > self._own

    @property
    def subscribers(self) -> int:
        """Number of subscriptions that the middleware has connected."""
        return self._count()

    def due(self, step: Step) -> bool:
        """Return whether to publish a step. A repeated step is published only for subscribers that lack it."""
        if step.again:
            untold = self._newcomers or self.latest < step.record.step
            return untold and (step.stored or self._count() > self._own)
        return step.first or step.stored or self.wanted

    def look_for_newcomers(self, *, thorough: bool = False) -> bool:
        """Return whether a subscriber is new since the last call, or lacks the last message.

        The ROS graph shows which new subscribers have volatile durability. The graph is read if the number of
        subscribers has grown, or if the last reading showed fewer subscribers than this number. With ``thorough`` it is
        read if there is any subscriber, because a new one may have replaced another one.
        """
        if not self._repeated:
            return False
        before, self._known = self._known, self._count()
        if (more := self._known > before) or self._unsure or (thorough and self._known > self._own):
            self._greet()
        return more or self._newcomers

    def _greet(self) -> None:
        """Search the ROS graph for new volatile subscribers. DDS itself delivers the last message to all others."""
        listeners = self._node.get_subscriptions_info_by_topic(self.info.name)
        self._unsure = len(listeners) < self._count()
        volatile = (each for each in listeners if each.qos_profile.durability is DurabilityPolicy.VOLATILE)
        before, self._greeted = self._greeted, {bytes(each.endpoint_gid) for each in volatile}
        self._newcomers |= bool(self._greeted - before)

    def send_step(self, step: Step, message: Any) -> None:
        """Send a message of a step; the message of a repeated step is not recorded again."""
        self._newcomers, self.latest = False, step.record.step
        self.send(message, step.log_time, recorded=not step.again)

    def send(self, message: Any, log_time: int, *, recorded: bool = True) -> None:
        """Serialise, publish and record a message.

        Args:
            message: message of the topic's type, or its serialised bytes.
            log_time: log time of the message in the bag [ns].
            recorded: whether the message is recorded in the bag in progress.
        """
        data = message if isinstance(message, bytes) else serialize_message(message)
        self._publisher.publish(data)
        if recorded and self.recorder is not None:
            self.recorder.record(self.info.name, data, log_time)

    def destroy(self) -> None:
        """Remove the topic from the graph."""
        self._held.close()
        self._count = lambda: 0
        self._node.destroy_lifecycle_publisher(self._publisher)


class StepPublisher:
    """Publishes steps in order, in a separate thread.

    Args:
        handle: function that publishes and records one step; it must not raise.

    Attributes:
        spent: wall time spent on publishing and recording so far [s].
    """

    def __init__(self, handle: Callable[[Step], None]) -> None:
        self._handle = handle
        self.spent = 0.0
        self._steps: queue.Queue[Step | None] = queue.Queue(maxsize=_WAITING)
        self._thread = threading.Thread(target=self._run, name=PUBLISHER, daemon=True)
        self._thread.start()

    def put(self, step: Step) -> None:
        """Queue a step for publishing; wait while two other steps are in the queue."""
        self._steps.put(step)

    def flush(self) -> None:
        """Wait until every queued step is published."""
        self._steps.join()

    def stop(self) -> None:
        """Publish the queued steps and end the thread."""
        self._steps.put(None)
        self._thread.join()

    def _run(self) -> None:
        show_name()
        while (step := self._steps.get()) is not None:
            started = time.perf_counter()
            try:
                self._handle(step)
            finally:
                self.spent += time.perf_counter() - started
                self._steps.task_done()


class UnmatchedTopics:
    """Searches for publishers on command topics of unknown handles, obstacles and bodies; each topic is reported once.

    Args:
        node: node whose topics are examined.
        handles: handles of the scene, including obstacles and rigid bodies.
        refusals: log that receives the reports as refused commands.
    """

    def __init__(self, node: LifecycleNode, handles: Collection[Handle], refusals: RefusalLog) -> None:
        self._node, self._refusals = node, refusals
        self._sections = {handle.name: handle.section for handle in handles}
        self._patterns = [
            (section, *node.resolve_topic_name(re.sub("{.*}", "h", spec.name)).rsplit("h/", 1))
            for commands in (topics.POSE_COMMANDS, topics.VELOCITY_COMMANDS)
            for section, spec in commands.items()
        ]
        self._told: set[str] = set()

    def look(self) -> None:
        """Report publishers that have appeared on topics of unknown names."""
        for topic, _ in self._node.get_topic_names_and_types():
            for section, before, after in self._patterns:
                if topic.startswith(before) and topic.endswith(f"/{after}"):
                    self._judge(topic, section, topic[len(before) : -len(after) - 1])

    def _judge(self, topic: str, section: str, name: str) -> None:
        there = self._sections.get(name)
        if there == section or topic in self._told or not self._node.count_publishers(topic):
            return
        self._told.add(topic)
        known = [each for each, its in self._sections.items() if its == section]
        hint = did_you_mean(name, known)
        if there is not None:
            hint = f"its topics are ~/{there}/{name}/...; "
        text = f"the scene has no {name!r} among its {section}; {hint}{section}: {', '.join(known) or 'none'}"
        self._refusals.refuse(topic, Refusal(Reason.UNKNOWN, text))


def namesakes(node: Node, name: str) -> int:
    """Return the number of nodes with the full name ``name`` in the graph that ``node`` has discovered."""
    namespace, _, base = name.rpartition("/")
    return node.get_node_names_and_namespaces().count((base, namespace or "/"))


class Doubles:
    """Searches for a second node of this node's name and a second publisher of /clock; logs each warning once.

    Args:
        node: node whose name and clock should be unique.

    Attributes:
        found: text about the duplicates; empty if there are none.
    """

    def __init__(self, node: LifecycleNode) -> None:
        self._node, self.found = node, ""

    def look(self) -> None:
        """Search the ROS graph once, and log new duplicates."""
        node, own = self._node, (self._node.get_name(), self._node.get_namespace())
        found = []
        name = node.get_fully_qualified_name()
        if (count := namesakes(node, name)) > 1:
            text = f"{count} nodes are called {name}, and commands reach all of them"
            found.append(f"{text}; remedy: remap __node or __ns of all but one")
        clock = node.resolve_topic_name(topics.CLOCK.name)
        giving = any(info.node_name == own[0] for info in node.get_publishers_info_by_topic(clock))
        if giving and (count := node.count_publishers(clock)) > 1:
            text = f"{count} publishers of {clock} make time jump back and forth"
            found.append(f"{text}; remedy: set publish_clock to false in all but one")
        text = "; ".join(found)
        if text and text != self.found:
            node.get_logger().warning(text)
        self.found = text
