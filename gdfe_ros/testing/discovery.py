# SPDX-License-Identifier: Apache-2.0
"""Wait until the node of a simulation has discovered the subscriptions and clients of another node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from gdfe_ros.node.interface.topics import DIAGNOSTICS, PROCESS

_LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def await_discovery(
    node: Node, simulation: str, wait: Callable[[Callable[[], Any]], Any], *, process: int | None = None
) -> None:
    """Wait until a simulation has discovered every subscription and service client that ``node`` has so far.

    This is needed because a service counts as ready once requests reach it, but its response is lost if the server has
    not yet discovered the client. DDS announces the endpoints of a node in the order of their creation. This function
    makes a new subscription; once the subscription receives diagnostics, the simulation has therefore discovered all
    earlier endpoints.

    Args:
        node: node with the subscriptions and clients.
        simulation: full name of the simulation's node.
        wait: function that spins the node until its argument, a function, returns a true value.
        process: process id of the simulation, in case another node has its name; None: any process.
    """
    heard: list[DiagnosticArray] = []
    wanted = f"{simulation.lstrip('/')}: "

    def hear(message: DiagnosticArray) -> None:
        own = [status for status in message.status if status.name.startswith(wanted)]
        numbers = {value.value for status in own for value in status.values if value.key == PROCESS}
        if own and (process is None or str(process) in numbers):
            heard.append(message)

    subscription = node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, hear, _LATCHED)
    wait(lambda: heard)
    node.destroy_subscription(subscription)
