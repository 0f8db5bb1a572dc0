# SPDX-License-Identifier: Apache-2.0
"""Output topics of a simulation, published for each step or once for each scene, and their recording in bags."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import Any

from rosgraph_msgs.msg import Clock

from gdfe_ros.errors import GdfeError
from gdfe_ros.node import messages
from gdfe_ros.node.driving.pace import ClockMode
from gdfe_ros.node.inputs import Inputs
from gdfe_ros.node.interface import TopicSpec, topics
from gdfe_ros.node.interface.topics import step_topic
from gdfe_ros.node.messages import ContactMarkers, SurfaceMarker, TransformPacker
from gdfe_ros.node.middleware.channel import Channel
from gdfe_ros.node.run import Run
from gdfe_ros.recording.bag_info import make_run_folder
from gdfe_ros.recording.packing import pack_text, packers
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.recorder import Recorder, RecorderStatus
from gdfe_ros.recording.step import Step, to_nanoseconds
from gdfe_ros.results.contacts import contact_names, contact_points


class Output:
    """A topic with a message for each step; no message is built for a topic without subscriber or bag.

    Args:
        channel: channel of the topic.
        pack: function that returns the message of a step, or its bytes.
        period: function that returns the shortest wall time between two messages [s]; steps in between have no message.
            None: each step has one.
    """

    def __init__(
        self, channel: Channel, pack: Callable[[Step], Any], *, period: Callable[[], float] | None = None
    ) -> None:
        self.channel, self._pack, self._period = channel, pack, period or (lambda: 0.0)
        self._seldom, self._sent = period is not None, -math.inf

    @property
    def wanted(self) -> bool:
        """Whether a subscriber or a bag needs the next step's message, and the period since the last one is over."""
        return time.monotonic() >= self._sent + self._period() and self.channel.wanted

    def publish(self, step: Step) -> None:
        """Publish and record the message of a step, if it is due."""
        seldom = self._seldom and not step.again
        if not (self.wanted if seldom else self.channel.due(step)):
            return
        self._sent = time.monotonic()
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

    def look_for_newcomers(self, *, thorough: bool = False) -> bool:
        """Return whether a subscriber lacks the present state; ``thorough``: see `Channel.look_for_newcomers`."""
        # Ask every channel, without stopping at the first: each one notes its new subscribers.
        return any([channel.look_for_newcomers(thorough=thorough) for channel in self.channels])

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
        """Yield description, name, and a function that returns the message, of each latched topic.

        An empty name stands for the name in the description.
        """
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
        """Yield the outputs of a step, in no particular order."""
        scene, parameters = self._scene, self._run.parameters
        if parameters["publish_clock"]:
            yield Output(channel(topics.CLOCK), _pack_clock)
        for key, pack in packers(scene, self._frames.full_name).items():
            yield Output(channel(step_topic(key), key=key), pack)
        if self._publishes_tf:
            packer = TransformPacker(self._frames.moving, self._frames.parents)

            def pack_transforms(step: Step) -> bytes:
                return packer.pack(step.record.stamp, self._frames.places(step))

            yield Output(channel(topics.TF, own=1), pack_transforms)

        def period() -> float:
            return 1.0 / parameters["marker_rate"]

        if self._contacts:
            pack = partial(self._pack_contacts, ContactMarkers(scene))
            yield Output(channel(topics.CONTACT_MARKERS), pack, period=period)
        yield Output(channel(topics.MARKERS), self._pack_surface, period=period)

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


class Bags:
    """Records the topics of a session, one bag at a time.

    Args:
        run: the recorded run; its parameter ``bag_path`` is the directory of the next bag.
        inputs: command topics; their messages are recorded as received.
        outputs: output topics; their messages are recorded as published.

    Attributes:
        recorder: recorder of the bag in progress, or of the last bag; None before the first.
        active: whether a bag is being written.
    """

    def __init__(self, run: Run, inputs: Inputs, outputs: TopicOutputs) -> None:
        self._run, self._logger = run, run.node.get_logger()
        self._inputs, self._outputs = inputs, outputs
        self.recorder: Recorder | None = None
        self.active = False

    def require_none(self) -> None:
        """Raise an error while a bag is being written, because a replay could not follow a change from outside.

        Raises:
            GdfeError: a bag is being written.
        """
        if self.active:
            raise GdfeError("a bag is being written, and a replay could not follow; finish it first with ~/record")

    def begin(self, state: bytes | None) -> str:
        """Begin a bag in the directory ``bag_path`` (default: ``runs/<scene>_<time>``); return a text with its path.

        If the disk is too slow under the wall clock, messages are dropped and counted. Under other clocks the steps
        wait for the disk.

        Args:
            state: serialised state from which the first step starts; None: the initial state of the scene.

        Raises:
            RecordingError: the bag cannot be created.
        """
        topics = [*self._inputs.infos, *(channel.info for channel in self._outputs.channels if channel.recorded)]
        scene, parameters = self._run.scene, dict(self._run.parameters)
        waits = parameters["clock"] != ClockMode.WALL.value
        self.recorder = Recorder(
            parameters["bag_path"] or make_run_folder(scene.name),
            topics,
            run=RunInfo.of(scene, node=parameters, state=state),
            waits=waits,
            failed=self._say_failed,
        )
        self._attach(self.recorder)
        self._outputs.publish_scene(self._run.log_time)
        text = f"recording to {self.recorder.path}"
        self._logger.info(text)
        return text

    def finish(self) -> str:
        """Finish the bag and return a summary; `failed` then states whether the recording ended early."""
        self._attach(None)
        status = self.recorder.close()
        text = status.summary(self.recorder.path)
        # On separate lines: rclpy binds a severity permanently to the line that logs.
        if status.error is None:
            self._logger.info(text)
        else:
            self._logger.error(text)
        return text

    @property
    def failed(self) -> bool:
        """Whether the recording of the bag in progress, or of the last bag, ended early because of an error."""
        return self.recorder is not None and self.recorder.error is not None

    def _say_failed(self, status: RecorderStatus) -> None:
        """Log that the recording has failed; called in the recorder's thread. The simulation continues."""
        self._logger.error(f"recording ended, the simulation goes on: {status.summary(self.recorder.path)}")

    def _attach(self, recorder: Recorder | None) -> None:
        self._outputs.attach(recorder)
        self._inputs.recorder = recorder
        self.active = recorder is not None
