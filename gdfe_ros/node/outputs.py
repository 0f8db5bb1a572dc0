# SPDX-License-Identifier: Apache-2.0
"""Output topics of a simulation, published for each step or once for each scene."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cached_property, partial

from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from gdfe_ros.constraints import Pose
from gdfe_ros.node import messages
from gdfe_ros.node.channel import Channel, any_wanted, due
from gdfe_ros.node.contact_outputs import ContactOutputs
from gdfe_ros.node.handle_outputs import HandleOutputs
from gdfe_ros.node.interface import topics
from gdfe_ros.node.markers import SurfaceMarker
from gdfe_ros.node.motion_outputs import MotionOutputs
from gdfe_ros.node.packing import MeshPacker, PosePacker, StrainPacker, TransformPacker
from gdfe_ros.node.run import Run
from gdfe_ros.node.step import Demand, Step, to_nanoseconds
from gdfe_ros.recording.recorder import Recorder


class TopicOutputs:
    """Publishes a scene and its steps; no message is built for a topic without subscriber or bag.

    Args:
        run: the published run.
    """

    def __init__(self, run: Run) -> None:
        node, scene, frames = run.node, run.scene, run.frames
        self._run, self._frames, self._frame_id = run, frames, frames.frame_id
        publish_tf = frames.transforms is not None and run.parameters["publish_tf"]
        each_step = partial(Channel, node, repeated=True)
        self._mesh, self._strain = each_step(topics.MESH), each_step(topics.STRAIN)
        self._record, self._markers = each_step(topics.STEP_RECORD), each_step(topics.MARKERS)
        self._topology, self._scene_text = Channel(node, topics.TOPOLOGY), Channel(node, topics.SCENE)
        self._handles = HandleOutputs(run, each_step)
        self._probes = {name: each_step(topics.PROBE, probe=name) for name in scene.probes}
        self._motion = MotionOutputs(run, each_step) if scene.dynamics else None
        self._contacts = ContactOutputs(run, each_step)
        self._joints = each_step(topics.JOINT_STATES) if scene.actuators or scene.arms else None
        self._robots = {arm.name: Channel(node, topics.ROBOT_DESCRIPTION, arm=arm.name) for arm in scene.arms}
        self._jacobian = Channel(node, topics.JACOBIAN) if scene.actuators and scene.probes else None
        self._clock = each_step(topics.CLOCK) if run.parameters["publish_clock"] else None
        self._tf = each_step(topics.TF, own=1) if publish_tf else None
        self._tf_static = Channel(node, topics.TF_STATIC) if publish_tf else None
        clock = () if self._clock is None else (self._clock,)
        self._plain = (self._mesh, self._record, *clock, *self._probes.values())
        self._mesh_packer = MeshPacker(scene.mesh.vertices, self._frame_id)
        self._probe_packer = PosePacker(self._frame_id)
        self._transform_packer = TransformPacker(frames.moving, frames.parents) if publish_tf else None
        self._strain_packer: StrainPacker | None = None
        self._actuator_states = messages.ActuatorStates(scene)
        self._next_marker = 0.0

    @property
    def channels(self) -> Iterator[Channel]:
        """Channels of all output topics, in no particular order."""
        yield from (self._mesh, self._strain, self._record, self._topology, self._scene_text, self._markers)
        yield from (*self._handles.channels, *self._probes.values(), *self._robots.values())
        yield from self._contacts.channels
        if self._motion is not None:
            yield from self._motion.channels
        for channel in (self._joints, self._jacobian, self._clock, self._tf, self._tf_static):
            if channel is not None:
                yield channel

    def demand(self) -> Demand:
        """Return the outputs of the next step that a subscriber or a bag needs."""
        # Read ``wanted`` of each channel at most once, because counting subscribers is a call into the middleware.
        fields = self._strain.wanted or self._marker_due()
        frames = self._tf is not None and self._tf.wanted
        poses = frames or self._handles.poses_wanted
        actuators = self._joints is not None and self._joints.wanted
        imus = frames or (self._motion is not None and self._motion.imus_wanted)
        told = fields or poses or actuators or imus or self._handles.wrenches_wanted or any_wanted(self._plain)
        return Demand(
            messages=told or self._contacts.wanted or (self._motion is not None and self._motion.velocity_wanted),
            fields=fields,
            poses=poses,
            actuators=actuators,
            imus=imus,
        )

    def missed(self, *, thorough: bool = False) -> bool:
        """Return whether a subscriber has not received the present state; ``thorough``: see `Channel.missed`."""
        return any([channel.missed(thorough=thorough) for channel in self.channels])

    def attach(self, recorder: Recorder | None) -> None:
        """Record all topics that bags contain, from now on; None ends the recording."""
        for channel in self.channels:
            channel.recorder = recorder if channel.recorded else None

    def publish_scene(self, log_time: int) -> None:
        """Publish the latched topics; ``log_time`` is their log time in the bag [ns]."""
        self._topology.send(messages.topology(self._run.scene.mesh.cells), log_time)
        self._scene_text.send(String(data=self._run.scene.source), log_time)
        self._contacts.publish_names(log_time)
        for arm in self._run.scene.arms:
            self._robots[arm.name].send(String(data=arm.text), log_time)
        if self._tf_static is not None:
            rests = self._frames.rests()
            packer = TransformPacker(list(rests), [self._frame_id] * len(rests))
            self._tf_static.send(packer.pack(self._run.clock(), list(rests.values())), log_time)

    def publish_jacobian(self, values: object, log_time: int) -> None:
        """Publish the Jacobian d(probe position) / d(command), (probes, 3, actuators)."""
        names = [actuator.name for actuator in self._run.scene.actuators]
        self._jacobian.send(messages.jacobian(values, list(self._run.scene.probes), names), log_time)

    def publish_step(self, step: Step) -> None:
        """Publish and record a step."""
        stamp = step.record.stamp
        if self._clock is not None and self._clock.due(step):
            self._clock.send_step(step, Clock(clock=messages.to_time(to_nanoseconds(step.record.time))))
        if self._mesh.due(step):
            self._mesh.send_step(step, self._mesh_packer.pack(stamp, step.result.positions))
        if self._record.due(step):
            self._record.send_step(step, String(data=step.record.to_json()))
        self._handles.publish_wrenches(step)
        if step.poses:
            self._handles.publish_poses(step)
            self._publish_transforms(step)
        for name, channel in due(self._probes, step):
            channel.send_step(step, self._probe_packer.pack(stamp, self._probe(name, step)))
        if (step.actuators or not self._run.scene.actuators) and self._joints is not None and self._joints.due(step):
            message = self._actuator_states.message(messages.header(stamp, self._frame_id), step)
            self._joints.send_step(step, message)
        self._contacts.publish_step(step)
        if self._motion is not None:
            self._motion.publish_step(step)
        if step.fields is not None:
            self._publish_fields(step)

    def destroy(self) -> None:
        """Remove the topics from the graph."""
        for channel in self.channels:
            channel.destroy()

    def _publish_transforms(self, step: Step) -> None:
        """Publish the frames of handles, obstacles, probes and links."""
        if self._tf is not None and self._tf.due(step):
            probes = {name: self._probe(name, step) for name in self._run.scene.probes}
            units = step.imus() if step.imus else {}
            places = self._frames.places(step.poses, probes, units, step.result.positions, step.links)
            self._tf.send_step(step, self._transform_packer.pack(step.record.stamp, places))

    def _probe(self, name: str, step: Step) -> Pose:
        return messages.material_pose(
            self._run.scene.probes[name], self._run.scene.mesh.vertices, step.result.positions
        )

    @cached_property
    def _surface(self) -> SurfaceMarker:
        return SurfaceMarker(self._run.scene.mesh, self._frame_id)

    def _marker_due(self) -> bool:
        return time.monotonic() >= self._next_marker and self._markers.wanted

    def _publish_fields(self, step: Step) -> None:
        marker = self._markers.due(step) if step.again else self._marker_due()
        if not marker and not self._strain.due(step):
            return
        fields = step.fields()
        if self._strain.due(step):
            self._strain_packer = self._strain_packer or StrainPacker(fields, self._frame_id)
            self._strain.send_step(step, self._strain_packer.pack(step.record.stamp, fields))
        if marker:
            choice = self._run.parameters
            self._next_marker = time.monotonic() + 1.0 / choice["marker_rate"]
            values = getattr(fields, choice["marker_field"])
            self._markers.send_step(step, self._surface.pack(step.record.stamp, step.result.positions, values))
