# SPDX-License-Identifier: Apache-2.0
"""Topics that only scenes with dynamics have."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from gdfe_ros.node.channel import Channel
from gdfe_ros.node.interface import topics
from gdfe_ros.node.packing import ImuPacker, VelocityPacker
from gdfe_ros.node.run import Run
from gdfe_ros.node.step import Step


class MotionOutputs:
    """Publishes the motion of a body; no message is built for a topic without subscriber or bag.

    Args:
        run: the published run; its scene has dynamics.
        channel: function that makes the channel of a topic with a message for each step.
    """

    def __init__(self, run: Run, channel: Callable[..., Channel]) -> None:
        self._velocity = channel(topics.VERTEX_VELOCITY)
        self._imus = {name: channel(topics.IMU, probe=name) for name in run.scene.probes}
        self._imu_packers = {name: ImuPacker(run.frames.imu(name)) for name in run.scene.probes}
        self._velocity_packer = VelocityPacker(run.scene.mesh.vertices, run.frames.frame_id)

    @property
    def channels(self) -> Iterator[Channel]:
        """Channels of all motion topics, in no particular order."""
        yield self._velocity
        yield from self._imus.values()

    @property
    def velocity_wanted(self) -> bool:
        """Whether a subscriber or a bag needs the vertices' velocities of the next step."""
        return self._velocity.wanted

    @property
    def imus_wanted(self) -> bool:
        """Whether a subscriber or a bag needs a reading of an inertial measurement unit of the next step."""
        return any(channel.wanted for channel in self._imus.values())

    def publish_step(self, step: Step) -> None:
        """Publish and record the motion of a step."""
        if self._velocity.due(step):
            result = step.result
            cloud = self._velocity_packer.pack(step.record.stamp, result.positions, result.velocities)
            self._velocity.send_step(step, cloud)
        if step.imus is None:
            return
        for name, channel in self._imus.items():
            if channel.due(step):
                channel.send_step(step, self._imu_packers[name].pack(step.record.stamp, step.imus()[name]))
