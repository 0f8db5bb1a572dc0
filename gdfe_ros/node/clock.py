# SPDX-License-Identifier: Apache-2.0
"""The clock of a node: wall time, or another's /clock."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import JumpHandle, JumpThreshold
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.parameters import Parameters


class NodeClock:
    """Reads a node's clock, and tells when another sets it.

    Args:
        node: whose clock it is.
        parameters: of the node.
    """

    def __init__(self, node: LifecycleNode, parameters: Parameters) -> None:
        self._node, self._parameters = node, parameters

    def read(self) -> int:
        """Give its time [ns]; with ``use_sim_time`` 0 before the first /clock."""
        return self._node.get_clock().now().nanoseconds

    def follow(self, wake: Callable[[], object]) -> JumpHandle:
        """Have ``wake`` called whenever another sets the clock, until the handle is unregistered.

        Raises:
            GdfeError: the clock is not another's.
        """
        if not self._node.get_parameter("use_sim_time").value or self._parameters["publish_clock"]:
            raise GdfeError("clock external follows another's /clock: set use_sim_time true and publish_clock false")
        any_jump = JumpThreshold(
            min_forward=Duration(nanoseconds=1), min_backward=Duration(nanoseconds=-1), on_clock_change=True
        )
        return self._node.get_clock().create_jump_callback(any_jump, post_callback=lambda jump: wake())
