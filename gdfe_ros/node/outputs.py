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
from gdfe_ros.node.interface import topics
from gdfe_ros.node.interface.scene_topics import state_topics
from gdfe_ros.node.messages import ContactMarkers, SurfaceMarker, TransformPacker
from gdfe_ros.node.run import Run
from gdfe_ros.recording.packing import pack_text, packing
from gdfe_ros.recording.published import material_pose, tables_of
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.step import Demand, Step, to_nanoseconds

_PARTS = ("messages", "fields", "poses", "actuators", "imus")
"""Attributes of `Demand`."""


class Output:
    """A topic with a message for each step; no message is built for a topic without subscriber or bag.

    Args:
        channel: channel of the topic.
        pack: function that returns the message of a step, or its bytes.
        part: attribute of `Step` without which there is no message.
        needs: parts of the `Demand` that the message needs, besides ``part``.
        period: function that returns the shortest wall time between two messages [s], for a topic with a message for
            few steps; None: each step has one.
    """

    def __init__(
        self,
        channel: Channel,
        pack: Callable[[Step], Any],
        *,
        part: str = "result",
        needs: tuple[str, ...] = (),
        period: Callable[[], float] | None = None,
    ) -> None:
        self.channel, self._pack, self._part = channel, pack, part
        self.needs = {"messages", part, *needs} & set(_PARTS)
        self._period, self._next = period, 0.0

    @property
    def wanted(self) -> bool:
        """Whether a subscriber or a bag needs the message of the next step, and the last one is long enough ago."""
        return time.monotonic() >= self._next and self.channel.wanted

    def publish(self, step: Step) -> None:
        """Publish and record the message of a step, if it is due."""
        seldom = self._period is not None and not step.again
        if not getattr(step, self._part) or not (self.wanted if seldom else self.channel.due(step)):
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
        self._topology, self._scene_text = Channel(node, topics.TOPOLOGY), Channel(node, topics.SCENE)
        self._contact_names = Channel(node, topics.CONTACT_NAMES) if self._contacts else None
        described = topics.ROBOT_DESCRIPTION
        self._robots = [(arm, Channel(node, described, key=described.key(arm=arm.name))) for arm in scene.arms]
        self._jacobian = Channel(node, topics.JACOBIAN) if scene.actuators and scene.probes else None
        self._tf_static = Channel(node, topics.TF_STATIC) if self._publishes_tf else None
        outputs = self._make_outputs(partial(Channel, node, repeated=True))
        # Last those of element fields, whose evaluation would delay the others.
        self._outputs = sorted(outputs, key=lambda output: "fields" in output.needs)

    @property
    def channels(self) -> Iterator[Channel]:
        """Channels of all output topics, in no particular order."""
        yield from (output.channel for output in self._outputs)
        yield from (self._topology, self._scene_text, *(channel for _, channel in self._robots))
        optional = (self._contact_names, self._jacobian, self._tf_static)
        yield from (channel for channel in optional if channel is not None)

    def demand(self) -> Demand:
        """Return the outputs of the next step that a subscriber or a bag needs."""
        # Ask an output only if it adds to the demand, because counting subscribers is a call into the middleware.
        needs: set[str] = set()
        for output in self._outputs:
            if not output.needs <= needs and output.wanted:
                needs |= output.needs
        return Demand(**{part: part in needs for part in _PARTS})

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
        self._topology.send(messages.topology(self._scene.mesh.cells), log_time)
        self._scene_text.send(pack_text(self._run.scene.source), log_time)  # its moduli may have changed
        if self._contact_names is not None:
            self._contact_names.send(pack_text(json.dumps(self._contacts)), log_time)
        for arm, channel in self._robots:
            channel.send(pack_text(arm.text), log_time)
        if self._tf_static is not None:
            rests = self._frames.rests()
            packer = TransformPacker(list(rests), [self._frame_id] * len(rests))
            self._tf_static.send(packer.pack(self._run.clock(), list(rests.values())), log_time)

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

    def _make_outputs(self, channel: Callable[..., Channel]) -> Iterator[Output]:
        """Yield the outputs in the order in which a step is published."""
        scene, parameters = self._scene, self._run.parameters
        if parameters["publish_clock"]:
            yield Output(channel(topics.CLOCK), _pack_clock)
        yield Output(channel(topics.STEP_RECORD), lambda step: pack_text(step.record.to_json()))
        tables, specs = tables_of(scene), state_topics(scene)
        specs |= {key: topics.HANDLE_SENSOR for key in tables if key.endswith("/force_torque")}
        rows = [*(each.name for each in scene.actuators), *(joint.name for arm in scene.arms for joint in arm.joints)]
        for key, table in tables.items():
            frame_id = self._frames.full_name(table.frame) if table.frame else self._frame_id
            yield Output(channel(specs[key], key=key), packing(table, frame_id, rows), part=table.part)
        if self._publishes_tf:
            packer = TransformPacker(self._frames.moving, self._frames.parents)
            pack = partial(self._pack_transforms, packer)
            yield Output(channel(topics.TF, own=1), pack, part="poses", needs=("imus",))

        def period() -> float:
            return 1.0 / parameters["marker_rate"]

        if self._contacts:
            pack = partial(self._pack_contacts, ContactMarkers(scene))
            yield Output(channel(topics.CONTACT_MARKERS), pack, period=period)
        yield Output(channel(topics.MARKERS), self._pack_surface, period=period, part="fields")

    def _pack_transforms(self, packer: TransformPacker, step: Step) -> bytes:
        """Return the message with the frames of handles, obstacles, probes and links."""
        rest, positions = self._scene.mesh.vertices, step.result.positions
        probes = {name: material_pose(point, rest, positions) for name, point in self._scene.probes.items()}
        units = step.imus() if step.imus else {}
        places = self._frames.places(step.poses, probes, units, positions, step.links)
        return packer.pack(step.record.stamp, places)

    def _pack_contacts(self, markers: ContactMarkers, step: Step) -> Any:
        head = messages.header(step.record.stamp, self._frame_id)
        return markers.message(head, step.obstacles, contact_points(step.result.contacts))

    @cached_property
    def _surface(self) -> SurfaceMarker:
        return SurfaceMarker(self._scene.mesh, self._frame_id)

    def _pack_surface(self, step: Step) -> bytes:
        values = getattr(step.fields(), self._run.parameters["marker_field"])
        return self._surface.pack(step.record.stamp, step.result.positions, values)


def _pack_clock(step: Step) -> Clock:
    return Clock(clock=messages.to_time(to_nanoseconds(step.record.time)))
