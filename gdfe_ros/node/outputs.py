# SPDX-License-Identifier: Apache-2.0
"""The topics that describe a simulation: what each step and each scene publishes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from rclpy.lifecycle import LifecycleNode
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from gdfe_ros.node import interface, messages
from gdfe_ros.node.actuator_messages import ActuatorStates, jacobian
from gdfe_ros.node.channel import Channel
from gdfe_ros.node.markers import SurfaceMarker
from gdfe_ros.node.packing import MeshPacker, PosePacker, StrainPacker, WrenchPacker
from gdfe_ros.node.step import Demand, Step
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.elements.fields import ElementFields


@dataclass(frozen=True, kw_only=True)
class MarkerChoice:
    """What markers show.

    Attributes:
        rate: most markers a second of wall time [Hz].
        field: name of an element field.
    """

    rate: float
    field: str


class Outputs:
    """Publishes scenes and steps; no message is built for a topic that nobody wants.

    Args:
        node: that publishes.
        scene: that is simulated.
        frame_id: of the rest shape.
        publish_clock: whether this node gives the time on /clock.
        markers: gives what markers show.
    """

    def __init__(
        self,
        node: LifecycleNode,
        scene: Scene,
        *,
        frame_id: str,
        publish_clock: bool,
        markers: Callable[[], MarkerChoice],
    ) -> None:
        self._scene, self._frame_id, self._choice = scene, frame_id, markers
        self._mesh = Channel(node, interface.MESH)
        self._strain = Channel(node, interface.STRAIN)
        self._record = Channel(node, interface.STEP_RECORD)
        self._topology = Channel(node, interface.TOPOLOGY)
        self._scene_text = Channel(node, interface.SCENE)
        self._markers = Channel(node, interface.MARKERS)
        names = [handle.name for handle in scene.handles]
        self._poses = {name: Channel(node, interface.HANDLE_POSE, handle=name) for name in names}
        self._wrenches = {name: Channel(node, interface.HANDLE_WRENCH, handle=name) for name in names}
        self._probes = {name: Channel(node, interface.PROBE, probe=name) for name in scene.probes}
        self._joints = Channel(node, interface.JOINT_STATES) if scene.actuators else None
        self._jacobian = Channel(node, interface.JACOBIAN) if scene.actuators and scene.probes else None
        self._clock = Channel(node, interface.CLOCK) if publish_clock else None
        self._mesh_packer = MeshPacker(scene.mesh.vertices, frame_id)
        self._pose_packer, self._wrench_packer = PosePacker(frame_id), WrenchPacker(frame_id)
        self._strain_packer: StrainPacker | None = None
        self._actuator_states = ActuatorStates()
        self._next_marker = 0.0

    @property
    def channels(self) -> Iterator[Channel]:
        """Every topic, in no particular order."""
        yield from (self._mesh, self._strain, self._record, self._topology, self._scene_text, self._markers)
        for group in (self._poses, self._wrenches, self._probes):
            yield from group.values()
        for channel in (self._joints, self._jacobian, self._clock):
            if channel is not None:
                yield channel

    def demand(self) -> Demand:
        """Tell what is wanted of the next step."""
        each_step = (self._mesh, self._record, self._strain, self._joints, self._clock)
        named = (*self._wrenches.values(), *self._poses.values(), *self._probes.values())
        marker = self._marker_due()
        return Demand(
            messages=marker or any(channel is not None and channel.wanted for channel in (*each_step, *named)),
            fields=self._strain.wanted or marker,
            poses=any(channel.wanted for channel in self._poses.values()),
            actuators=self._joints is not None and self._joints.wanted,
        )

    def attach(self, recorder: Recorder | None) -> None:
        """Record every topic that bags hold from now on, or none."""
        for channel in self.channels:
            channel.recorder = recorder if channel.recorded else None

    def replace(self, scene: Scene, log_time: int) -> None:
        """Go on with a scene that differs in its materials only."""
        self._scene = scene
        self.publish_scene(log_time)

    def publish_scene(self, log_time: int) -> None:
        """Publish the latched topics; ``log_time`` is for the bag [ns]."""
        self._topology.send(messages.topology(self._scene.mesh.cells), log_time)
        self._scene_text.send(String(data=self._scene.source), log_time)

    def publish_jacobian(self, values: object, log_time: int) -> None:
        """Publish d position / d command (probes, 3, actuators)."""
        names = [actuator.name for actuator in self._scene.actuators]
        self._jacobian.send(jacobian(values, list(self._scene.probes), names), log_time)

    def publish_step(self, step: Step) -> None:
        """Publish and record a step."""
        moment, seconds = step.log_time, step.record.time
        if self._clock is not None and (step.first or self._clock.wanted):
            self._clock.send(Clock(clock=messages.stamp(seconds)), moment)
        if step.first or self._mesh.wanted:
            self._mesh.send(self._mesh_packer.pack(seconds, step.result.positions), moment)
        if step.first or self._record.wanted:
            self._record.send(String(data=step.record.to_json()), moment)
        for name, channel in _wanted(self._wrenches, step):
            channel.send(self._wrench_packer.pack(seconds, step.result.reactions[name]), moment)
        for name, channel in _wanted(self._poses, step):
            if name in step.poses:
                channel.send(self._pose_packer.pack(seconds, step.poses[name]), moment)
        for name, channel in _wanted(self._probes, step):
            pose = messages.material_pose(self._scene.probes[name], self._scene.mesh.vertices, step.result.positions)
            channel.send(self._pose_packer.pack(seconds, pose), moment)
        if step.actuators:
            self._joints.send(self._actuator_states.message(messages.header(seconds, self._frame_id), step), moment)
        if step.fields is not None:
            self._publish_fields(step, step.fields())

    def destroy(self) -> None:
        """Take the topics off the graph."""
        for channel in self.channels:
            channel.destroy()

    @cached_property
    def _surface(self) -> SurfaceMarker:
        return SurfaceMarker(self._scene.mesh, self._frame_id)

    def _marker_due(self) -> bool:
        return time.monotonic() >= self._next_marker and self._markers.wanted

    def _publish_fields(self, step: Step, fields: ElementFields) -> None:
        if step.first or self._strain.wanted:
            self._strain_packer = self._strain_packer or StrainPacker(fields, self._frame_id)
            self._strain.send(self._strain_packer.pack(step.record.time, fields), step.log_time)
        if self._marker_due():
            choice = self._choice()
            self._next_marker = time.monotonic() + 1.0 / choice.rate
            values = getattr(fields, choice.field)
            self._markers.send(self._surface.pack(step.record.time, step.result.positions, values), step.log_time)


def _wanted(channels: Mapping[str, Channel], step: Step) -> Iterator[tuple[str, Channel]]:
    return ((name, channel) for name, channel in channels.items() if step.first or channel.wanted)
