# SPDX-License-Identifier: Apache-2.0
"""When a simulation's process knows what another one listens to."""

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

    A service is "ready" once requests arrive; its answer is lost where the server does not know the client yet. DDS
    announces what listens in the order in which it was made: who hears diagnostics on a subscription made now is known
    with all that was made before.

    Args:
        node: that listens.
        simulation: full name of the simulation's node.
        wait: spins until what it is given returns something true.
        process: number of the simulation's process, where another node may have its name; None takes any.
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
