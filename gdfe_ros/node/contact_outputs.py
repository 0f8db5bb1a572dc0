# SPDX-License-Identifier: Apache-2.0
"""Contact topics: contact points of scenes with contact, and the wrenches of contact sensors."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator

from std_msgs.msg import String

from gdfe_ros.contacts import contact_names, contact_points
from gdfe_ros.node import messages
from gdfe_ros.node.channel import Channel
from gdfe_ros.node.contact_markers import ContactMarkers
from gdfe_ros.node.interface import topics
from gdfe_ros.node.packing import WrenchPacker
from gdfe_ros.node.run import Run
from gdfe_ros.node.step import Step


class ContactOutputs:
    """Publishes contacts; no message is built for a topic without subscriber or bag.

    Args:
        run: the published run.
        channel: function that makes the channel of a topic with a message for each step.
    """

    def __init__(self, run: Run, channel: Callable[..., Channel]) -> None:
        self._run, self._sensors = run, run.scene.sensors
        self._names = contact_names(run.scene.handles, run.scene.self_contact)
        self._frame_id = run.frames.frame_id
        self._points = channel(topics.CONTACTS) if self._names else None
        self._told = Channel(run.node, topics.CONTACT_NAMES) if self._names else None
        self._shown = channel(topics.CONTACT_MARKERS) if self._names else None
        self._markers, self._next_marker = ContactMarkers(run.scene), 0.0
        self._wrenches = {name: channel(topics.SENSOR_WRENCH, sensor=name) for name in self._sensors}
        self._packers = {name: WrenchPacker(run.frames.sensor(name)) for name in self._sensors}

    @property
    def channels(self) -> Iterator[Channel]:
        """Channels of all contact topics, in no particular order."""
        if self._points is not None:
            yield from (self._points, self._told, self._shown)
        yield from self._wrenches.values()

    @property
    def wanted(self) -> bool:
        """Whether a subscriber or a bag needs a contact topic of the next step."""
        touch = self._points is not None and (self._points.wanted or self._marker_due())
        return touch or any(channel.wanted for channel in self._wrenches.values())

    def publish_names(self, log_time: int) -> None:
        """Publish the names of the contacts; ``log_time`` is their log time in the bag [ns]."""
        if self._told is not None:
            self._told.send(String(data=json.dumps(self._names)), log_time)

    def publish_step(self, step: Step) -> None:
        """Publish and record the contacts of a step."""
        stamp, result = step.record.stamp, step.result
        if self._points is not None:
            self._publish_points(step)
        for name, channel in self._wrenches.items():
            if channel.due(step):
                channel.send_step(step, self._packers[name].pack(stamp, self._sensors[name].wrench(result)))

    def _publish_points(self, step: Step) -> None:
        marker = self._shown.due(step) if step.again else self._marker_due()
        if not marker and not self._points.due(step):
            return
        head, points = messages.header(step.record.stamp, self._frame_id), contact_points(step.result.contacts)
        if self._points.due(step):
            self._points.send_step(step, messages.contact_cloud(head, points))
        if marker:
            self._next_marker = time.monotonic() + 1.0 / self._run.parameters["marker_rate"]
            self._shown.send_step(step, self._markers.message(head, step.obstacles, points))

    def _marker_due(self) -> bool:
        return time.monotonic() >= self._next_marker and self._shown.wanted
