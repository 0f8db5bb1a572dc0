# SPDX-License-Identifier: Apache-2.0
"""Output topics of a simulation, published for each step or once for each scene."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import Any

from rosgraph_msgs.msg import Clock

from gdfe_ros.contacts import contact_names, contact_points
from gdfe_ros.node import messages
from gdfe_ros.node.channel import Channel
from gdfe_ros.node.interface import TopicSpec, topics
from gdfe_ros.node.interface.topics import state_topics
from gdfe_ros.node.messages import ContactMarkers, SurfaceMarker, TransformPacker
from gdfe_ros.node.run import Run
from gdfe_ros.recording.packing import pack_text, packers
from gdfe_ros.recording.published import material_pose
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.step import Step, to_nanoseconds


class Output:
    """A topic with a message for each step; no message is built for a topic without subscriber or bag.

    Args:
        channel: channel of the topic.
        pack: function that returns the message of a step, or its bytes.
        period: function that returns the shortest wall time between two messages [s], for a topic with a message for
            few steps; None: each step has one.
    """

    def __init__(
        self, channel: Channel, pack: Callable[[Step], Any], *, period: Callable[[], float] | None = None
    ) -> None:
        self.channel, self._pack, self._period, self._next = channel, pack, period, 0.0

    @property
    def wanted(self) -> bool:
        """Whether a subscriber or a bag needs the message of the next step, and the last one is long enough ago."""
        return time.monotonic() >= self._next and self.channel.wanted

    def publish(self, step: Step) -> None:
        """Publish and record the message of a step, if it is due."""
        seldom = self._period is not None and not step.again
        if not (self.wanted if seldom else self.channel.due(step)):
            return
        if self._period is not None:
            self._next = time.monotonic() + self._period()
        self.channel.send_step(step, self._pack(step))


class TopicOutputs:
    """Publishes a scene and its steps.

    Args:
        run: the published run.
    """

    def __init__(self, run: Run) -> None:
        node, scene, frames = run.node, run.scene, run.frames
        self._run, self._frames, self._scene, self._frame_id = run, frames, scene, frames.frame_id
        self._publishes_tf = frames.transforms is not None and run.parameters["publish_tf"]
        self._contacts = contact_names(scene.handles, scene.self_contact)
        self._latched = [(Channel(node, spec, key=key), pack) for spec, key, pack in self._make_latched()]
        self._jacobian = Channel(node, topics.JACOBIAN) if scene.actuators and scene.probes else None
        outputs = self._make_outputs(partial(Channel, node, repeated=True))
        # Last those of element fields, whose evaluation would delay the others.
        slow = (topics.STRAIN.key(), topics.MARKERS.key())
        self._outputs = sorted(outputs, key=lambda output: output.channel.info.role in slow)

    @property
    def channels(self) -> Iterator[Channel]:
        """Channels of all output topics, in no particular order."""
        yield from (output.channel for output in self._outputs)
        yield from (channel for channel, _ in self._latched)
        if self._jacobian is not None:
            yield self._jacobian

    @property
    def wanted(self) -> bool:
        """Whether a subscriber or a bag needs a message of the next step."""
        return any(output.wanted for output in self._outputs)

    def missed(self, *, thorough: bool = False) -> bool:
        """Return whether a subscriber has not received the present state; ``thorough``: see `Channel.missed`."""
        # Ask every channel, without stopping at the first: each one notes its new subscribers.
        return any([channel.missed(thorough=thorough) for channel in self.channels])

    def attach(self, recorder: Recorder | None) -> None:
        """Record all topics that bags contain, from now on; None ends the recording."""
        for channel in self.channels:
            channel.recorder = recorder if channel.recorded else None

    def publish_scene(self, log_time: int) -> None:
        """Publish the latched topics; ``log_time`` is their log time in the bag [ns]."""
        for channel, pack in self._latched:
            channel.send(pack(), log_time)

    def publish_jacobian(self, values: object, log_time: int) -> None:
        """Publish the Jacobian d(probe position) / d(command), (probes, 3, actuators)."""
        names = [actuator.name for actuator in self._scene.actuators]
        self._jacobian.send(messages.jacobian(values, list(self._scene.probes), names), log_time)

    def publish_step(self, step: Step) -> None:
        """Publish and record a step."""
        for output in self._outputs:
            output.publish(step)

    def destroy(self) -> None:
        """Remove the topics from the graph."""
        for channel in self.channels:
            channel.destroy()

    def _make_latched(self) -> Iterator[tuple[TopicSpec, str, Callable[[], Any]]]:
        """Yield topic, name with its braces filled, and function that returns the message, of the latched topics."""
        yield topics.TOPOLOGY, "", partial(messages.topology, self._scene.mesh.cells)
        yield topics.SCENE, "", lambda: pack_text(self._run.scene.source)  # its moduli may have changed
        if self._contacts:
            yield topics.CONTACT_NAMES, "", partial(pack_text, json.dumps(self._contacts))
        for arm in self._scene.arms:
            yield topics.ROBOT_DESCRIPTION, topics.ROBOT_DESCRIPTION.key(arm=arm.name), partial(pack_text, arm.text)
        if self._publishes_tf:
            rests = self._frames.rests()
            packer = TransformPacker(list(rests), [self._frame_id] * len(rests))
            yield topics.TF_STATIC, "", lambda: packer.pack(self._run.clock(), list(rests.values()))

    def _make_outputs(self, channel: Callable[..., Channel]) -> Iterator[Output]:
        """Yield the outputs in the order in which a step is published."""
        scene, parameters = self._scene, self._run.parameters
        if parameters["publish_clock"]:
            yield Output(channel(topics.CLOCK), _pack_clock)
        specs = state_topics(scene)
        for key, pack in packers(scene, self._frames.full_name).items():
            yield Output(channel(specs.get(key, topics.HANDLE_SENSOR), key=key), pack)
        if self._publishes_tf:
            packer = TransformPacker(self._frames.moving, self._frames.parents)
            pack = partial(self._pack_transforms, packer)
            yield Output(channel(topics.TF, own=1), pack)

        def period() -> float:
            return 1.0 / parameters["marker_rate"]

        if self._contacts:
            pack = partial(self._pack_contacts, ContactMarkers(scene))
            yield Output(channel(topics.CONTACT_MARKERS), pack, period=period)
        yield Output(channel(topics.MARKERS), self._pack_surface, period=period)

    def _pack_transforms(self, packer: TransformPacker, step: Step) -> bytes:
        """Return the message with the frames of handles, obstacles, probes and links."""
        rest, positions = self._scene.mesh.vertices, step.result.positions
        probes = {name: material_pose(point, rest, positions) for name, point in self._scene.probes.items()}
        places = self._frames.places(step.poses, probes, step.imus(), positions, step.links)
        return packer.pack(step.record.stamp, places)

    def _pack_contacts(self, markers: ContactMarkers, step: Step) -> Any:
        head = messages.header(step.record.stamp, self._frame_id)
        return markers.message(head, step.poses, contact_points(step.result.contacts))

    @cached_property
    def _surface(self) -> SurfaceMarker:
        return SurfaceMarker(self._scene.mesh, self._frame_id)

    def _pack_surface(self, step: Step) -> bytes:
        values = getattr(step.fields(), self._run.parameters["marker_field"])
        return self._surface.pack(step.record.stamp, step.result.positions, values)


def _pack_clock(step: Step) -> Clock:
    return Clock(clock=messages.to_time(to_nanoseconds(step.record.time)))
