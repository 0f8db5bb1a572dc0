# SPDX-License-Identifier: Apache-2.0
"""Topics of the handles, obstacles, rigid bodies and links: their poses, wrenches and wrist sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from scipy.spatial.transform import Rotation

from gdfe_ros.constraints.arm_link import ArmLink
from gdfe_ros.node.channel import Channel, any_wanted, due
from gdfe_ros.node.interface import topics
from gdfe_ros.node.packing import PosePacker, WrenchPacker
from gdfe_ros.node.run import Run
from gdfe_ros.node.step import Step


class HandleOutputs:
    """Publishes what moves or holds the body; no message is built for a topic without subscriber or bag.

    Args:
        run: the published run.
        channel: function that makes the channel of a topic with a message for each step.
    """

    def __init__(self, run: Run, channel: Callable[..., Channel]) -> None:
        handles, frames = run.scene.handles, run.frames
        names = [handle.name for handle in handles]
        braces = {handle.name: (topics.MOVED[handle.section], {handle.noun: handle.name}) for handle in handles}
        self._poses = {name: channel(moved.pose, **brace) for name, (moved, brace) in braces.items()}
        self._wrenches = {name: channel(moved.wrench, **brace) for name, (moved, brace) in braces.items()}
        held = [handle.name for handle in handles if handle.section == "handles"]
        self._sensors = {name: channel(topics.HANDLE_SENSOR, handle=name) for name in held}
        links = {handle.name for handle in handles if isinstance(handle, ArmLink)}
        # Pieces of links have no frames of their own: the frames of links are on TF.
        rests = {name: frames.frame_id if name in links else frames.rest(name) for name in names}
        centres = {name: frames.frame_id if name in links else frames.centre(name) for name in names}
        self._pose_packers = {name: PosePacker(rests[name]) for name in names}
        self._wrench_packers = {name: WrenchPacker(centres[name]) for name in names}
        self._sensor_packers = {name: WrenchPacker(frames.handle(name)) for name in held}

    @property
    def channels(self) -> Iterator[Channel]:
        """Channels of all these topics, in no particular order."""
        for group in (self._poses, self._wrenches, self._sensors):
            yield from group.values()

    @property
    def poses_wanted(self) -> bool:
        """Whether a subscriber or a bag needs a pose, or a wrench in a handle's axes, of the next step."""
        return any_wanted((*self._poses.values(), *self._sensors.values()))

    @property
    def wrenches_wanted(self) -> bool:
        """Whether a subscriber or a bag needs a wrench in the world's axes of the next step."""
        return any_wanted(self._wrenches.values())

    def publish_wrenches(self, step: Step) -> None:
        """Publish and record the wrenches of a step in the world's axes."""
        for name, channel in due(self._wrenches, step):
            channel.send_step(step, self._wrench_packers[name].pack(step.record.stamp, step.result.reactions[name]))

    def publish_poses(self, step: Step) -> None:
        """Publish and record the poses of a step, and the wrenches in the handles' axes."""
        stamp = step.record.stamp
        for name, channel in due(self._poses, step):
            channel.send_step(step, self._pose_packers[name].pack(stamp, step.poses[name]))
        for name, channel in due(self._sensors, step):
            back = Rotation.from_rotvec(step.poses[name].rotation).inv()
            felt = -back.apply(step.result.reactions[name].reshape(2, 3))
            channel.send_step(step, self._sensor_packers[name].pack(stamp, felt.ravel()))
