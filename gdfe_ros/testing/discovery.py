# SPDX-License-Identifier: Apache-2.0
"""When a simulation's process knows what another one listens to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from gdfe_ros.node.interface.topics import DIAGNOSTICS

_LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def await_discovery(node: Node, simulation: str, wait: Callable[[Callable[[], Any]], Any]) -> None:
    """Wait until a simulation has discovered every subscription and service client that ``node`` has so far.

    A service is "ready" once requests arrive; its answer is lost where the server does not know the client yet. DDS
    announces what listens in the order in which it was made: who hears diagnostics on a subscription made now is known
    with all that was made before.

    Args:
        node: that listens.
        simulation: full name of the simulation's node.
        wait: spins until what it is given returns something true.
    """
    heard: list[DiagnosticArray] = []
    wanted = f"{simulation.lstrip('/')}: "

    def hear(message: DiagnosticArray) -> None:
        if any(status.name.startswith(wanted) for status in message.status):
            heard.append(message)

    subscription = node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, hear, _LATCHED)
    wait(lambda: heard)
    node.destroy_subscription(subscription)
