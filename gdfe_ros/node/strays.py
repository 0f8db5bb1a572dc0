# SPDX-License-Identifier: Apache-2.0
"""Commands to names that the scene does not have: nobody subscribes, so only the graph shows them."""

from __future__ import annotations

from collections.abc import Collection
from difflib import get_close_matches

from rclpy.lifecycle import LifecycleNode

from gdfe_ros.node import interface
from gdfe_ros.node.refusals import Reason, Refusal, RefusalLog


class Strays:
    """Looks for publishers on command topics of handles that do not exist; each is told and counted once.

    Args:
        node: whose topics are looked at.
        handles: names that exist.
        refusals: counts and warns.
    """

    def __init__(self, node: LifecycleNode, handles: Collection[str], refusals: RefusalLog) -> None:
        self._node, self._handles, self._refusals = node, list(handles), refusals
        self._patterns = [
            tuple(node.resolve_topic_name(spec.name.replace("{handle}", "h")).rsplit("h/", 1))
            for spec in interface.COMMANDS
            if "{handle}" in spec.name
        ]
        self._told: set[str] = set()

    def look(self) -> None:
        """Look at the graph once."""
        for topic, _ in self._node.get_topic_names_and_types():
            for before, after in self._patterns:
                if topic.startswith(before) and topic.endswith(f"/{after}"):
                    self._judge(topic, topic[len(before) : -len(after) - 1])

    def _judge(self, topic: str, name: str) -> None:
        if name in self._handles or topic in self._told or not self._node.count_publishers(topic):
            return
        self._told.add(topic)
        close = get_close_matches(name, self._handles, n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        text = f"the scene has no handle {name!r}; {hint}handles: {', '.join(self._handles) or 'none'}"
        self._refusals.refuse(topic, Refusal(Reason.UNKNOWN, text))
