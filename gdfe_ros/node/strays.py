# SPDX-License-Identifier: Apache-2.0
"""Problems that only the ROS graph shows: commands to unknown names, a second node of the same name, a second clock."""

from __future__ import annotations

import re
from collections.abc import Collection

from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node

from gdfe_ros.constraints import Handle
from gdfe_ros.node.interface import topics
from gdfe_ros.node.refusals import Reason, Refusal, RefusalLog
from gdfe_ros.spelling import did_you_mean


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
            for section, moved in topics.MOVED.items()
            for spec in moved.commands
        ]
        self._told: set[str] = set()

    def look(self) -> None:
        """Examine the graph once."""
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
        """Examine the graph once."""
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
